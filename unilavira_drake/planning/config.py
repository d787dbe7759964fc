"""The planner's numbers in a scenario."""

import dataclasses as dc


@dc.dataclass
class PlanningConfig:
    """Goal snapping, progress watch and travel budget."""

    # A goal moves at most this far to reachable free space, metres.
    snap_distance: float = 1.5
    # Arrived within this distance of the goal, metres.
    tolerance: float = 0.10
    # Stuck after this long without progress, seconds.
    stuck_time: float = 6.0
    # Gives up after travelling this many times the planned length, plus 3 m.
    travel_factor: float = 3.0
    # Seconds to wait where the way is blocked on the drive; 0: detours and fails at once.
    patience: float = 0.0
