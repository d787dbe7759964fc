"""Unitree G1: a humanoid with four cameras in a ring."""

import dataclasses as dc

from unilavira_drake.robots.gait_config import Gait
from unilavira_drake.robots.robot import GroundRobot


@dc.dataclass
class UnitreeG1(GroundRobot):
    """Configuration of the robot; the scenario tag is ``!UnitreeG1``.

    Its own locomotion takes (vx, vy, wz) once a second and holds it (paper section V-A).
    """

    name: str = "unitree_g1"
    max_speed: float = 0.4
    max_yaw_rate: float = 0.5
    max_acceleration: float = 1.0
    max_yaw_acceleration: float = 2.0
    length: float = 0.35
    width: float = 0.50
    radius: float = 0.30
    turning_radius: float = 0.33
    image_width: int = 640
    image_height: int = 480
    horizontal_fov_degrees: float = 90.0
    min_depth: float = 0.1
    max_depth: float = 10.0
    sweep_direction: str = "left"
    control_period: float = 1.0
    can_climb: bool = False
    views: list[str] = dc.field(default_factory=lambda: ["front", "left", "back", "right"])
    holonomic: bool = True
    max_lateral_speed: float = 0.2
    command_period: float = 1.0
    gait: Gait = dc.field(
        default_factory=lambda: Gait(
            frequency=1.6, heave=0.015, roll_degrees=2.5, pitch_degrees=1.5, swing_degrees=20.0
        )
    )
