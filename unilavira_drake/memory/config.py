"""The memories' numbers in a scenario."""

import dataclasses as dc


@dc.dataclass
class MemoryConfig:
    """Bounds of what the agent remembers."""

    waypoints: int = 32
    # Decisions told in the history.
    decisions: int = 8
    # Egocentric key frames of one leg, and the travel between two of them, metres.
    keyframes: int = 6
    keyframe_travel: float = 1.5
    # A place closer than this to a waypoint is that waypoint, metres.
    merge_distance: float = 0.5
