"""File 1 of 4, the configuration: sizes, limits and cameras of a cart on two tracks."""

import dataclasses as dc
from pathlib import Path

from unilavira_drake.robots.robot import GroundRobot


@dc.dataclass
class TrackedCart(GroundRobot):
    """A cart of 0.52 x 0.44 m with one camera on a mast; the scenario tag is ``!TrackedCart``."""

    name: str = "tracked_cart"
    max_speed: float = 0.5
    max_yaw_rate: float = 1.0
    max_acceleration: float = 0.8
    max_yaw_acceleration: float = 2.0
    length: float = 0.52
    width: float = 0.44
    radius: float = 0.28
    turning_radius: float = 0.40
    image_width: int = 640
    image_height: int = 480
    horizontal_fov_degrees: float = 86.0
    min_depth: float = 0.1
    max_depth: float = 10.0
    sweep_direction: str = "right"
    control_period: float = 0.05
    can_climb: bool = False
    views: list[str] = dc.field(default_factory=lambda: ["front"])
    model: str = str(Path(__file__).with_name("tracked_cart.sdf"))
    # Distance between the tracks, metres, and their fastest speed, m/s.
    gauge: float = 0.36
    top_track_speed: float = 0.8
