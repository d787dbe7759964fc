"""What a scenario says of flying in its world: the air, its borders, the map and the goals."""

import dataclasses as dc


@dc.dataclass
class WindConfig:
    """The air that moves; the gusts' seed is the scenario's."""

    # Steady wind, m/s, and where it blows to, degrees counter-clockwise from the world's x axis.
    speed: float = 0.0
    direction_degrees: float = 0.0
    # Standard deviation of the horizontal gusts, m/s, and their correlation time, seconds.
    gusts: float = 0.0
    correlation_time: float = 2.0


@dc.dataclass
class FlightConfig:
    """How aircraft fly in this world; the defaults suit rooms.  Metres unless said otherwise."""

    # The episode begins with a climb to this height of the centre.
    takeoff_altitude: float = 1.2
    # Lowest and highest centre.
    min_altitude: float = 0.4
    max_altitude: float = 2.2
    # x_min, y_min, x_max, y_max that the centre never leaves; empty: no fence.  As the wind, it is
    # written for the world as its file says, and is mirrored with it.
    geofence: list[float] = dc.field(default_factory=list)
    # Kept free below and above the centre.
    ground_margin: float = 0.35
    ceiling_margin: float = 0.25
    # Kept between the aircraft and what was marked: before it, and above it.
    stand_off: float = 1.0
    goal_clearance: float = 0.8
    # Longest way of one move; a farther goal is flown in several (the paper's UAV: 5 m).
    horizon: float = 5.0
    # A goal moves at most this far to free space; arrived within the tolerance.
    snap_distance: float = 1.5
    tolerance: float = 0.2
    # Stuck after this long without progress, seconds; gives up after travelling this many times
    # the planned length, plus 10 m.
    stuck_time: float = 8.0
    travel_factor: float = 3.0
    # The voxel map: side of a voxel, range of depth, every so many rows and columns of an image.
    resolution: float = 0.1
    max_range: float = 5.0
    stride: int = 8
    # It is updated after this much travel or turning (degrees); at rest this often (seconds).
    travel: float = 0.7
    turn_degrees: float = 20.0
    rest_period: float = 2.0
    wind: WindConfig = dc.field(default_factory=WindConfig)

    def mirrored_if(self, world_is_mirrored: bool) -> "FlightConfig":
        """Returns what holds in the world itself: in a mirrored one fence and wind are, too."""
        if not world_is_mirrored:
            return self
        fence = self.geofence
        return dc.replace(
            self,
            geofence=[fence[0], -fence[3], fence[2], -fence[1]] if fence else [],
            wind=dc.replace(self.wind, direction_degrees=-self.wind.direction_degrees),
        )
