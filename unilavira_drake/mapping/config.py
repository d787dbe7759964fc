"""The mapper's numbers in a scenario."""

import dataclasses as dc


@dc.dataclass
class MappingConfig:
    """The occupancy map and when it is updated."""

    # Side of a cell, metres.
    resolution: float = 0.05
    # Depth is integrated up to this range, metres.
    max_range: float = 5.0
    # Heights above the floor that count as obstacles, metres.
    min_height: float = 0.10
    max_height: float = 1.40
    # Every so many rows and columns of a depth image; 3 pixels at 5 m are less than a cell.
    stride: int = 3
    # Update after this much travel (metres) or turning (degrees); at rest this often (seconds).
    travel: float = 0.2
    turn_degrees: float = 20.0
    rest_period: float = 2.0
    # Whether things are expected to move about: then what appears on free floor is believed at the
    # first look, and forgotten as fast when it is gone.
    moving: bool = False
