"""The memories' numbers in a scenario."""

import dataclasses as dc


@dc.dataclass
class MemoryConfig:
    """Bounds of what the agent remembers."""

    waypoints: int = 32
    # Decisions told in the history.
    decisions: int = 4
    # Pictures of the past that stay in the prompt once there are so many; four are dropped at a
    # time, those from the way first, so up to three more are shown. The preset paper keeps twice
    # as many.
    keyframes: int = 8
    # Travel between two pictures on the way, metres.
    keyframe_travel: float = 1.5
    # A place closer than this to a waypoint is that waypoint, metres.
    merge_distance: float = 0.5
