"""Unitree Go1: a quadruped with four cameras in a ring."""

import dataclasses as dc

from unilavira_drake.robots.gait_config import Gait
from unilavira_drake.robots.robot import GroundRobot


@dc.dataclass
class UnitreeGo1(GroundRobot):
    """Configuration of the robot; the scenario tag is ``!UnitreeGo1``.

    Its own walking mode takes (vx, vy, wz) at once and trots.
    """

    name: str = "unitree_go1"
    # Far below the 3 m/s of which it is capable: indoors.
    max_speed: float = 0.6
    max_yaw_rate: float = 1.2
    max_acceleration: float = 1.0
    max_yaw_acceleration: float = 3.0
    length: float = 0.65
    width: float = 0.30
    radius: float = 0.17
    turning_radius: float = 0.37
    image_width: int = 640
    image_height: int = 480
    horizontal_fov_degrees: float = 90.0
    min_depth: float = 0.1
    max_depth: float = 10.0
    sweep_direction: str = "left"
    control_period: float = 0.05
    can_climb: bool = False
    views: list[str] = dc.field(default_factory=lambda: ["front", "left", "back", "right"])
    holonomic: bool = True
    max_lateral_speed: float = 0.3
    gait: Gait = dc.field(
        default_factory=lambda: Gait(
            frequency=2.6, heave=0.012, roll_degrees=1.5, pitch_degrees=1.2, swing_degrees=22.0
        )
    )
