"""Agilex Cobot Magic: a differential base with a chest camera."""

import dataclasses as dc

from unilavira_drake.robots.robot import GroundRobot


@dc.dataclass
class CobotMagic(GroundRobot):
    """Configuration of the robot; the scenario tag is ``!CobotMagic``."""

    name: str = "cobot_magic"
    # Below the base's own 1.8 m/s.
    max_speed: float = 0.8
    max_yaw_rate: float = 1.5
    max_acceleration: float = 1.0
    max_yaw_acceleration: float = 3.0
    length: float = 0.69
    width: float = 0.57
    radius: float = 0.36
    turning_radius: float = 0.52
    image_width: int = 640
    image_height: int = 480
    horizontal_fov_degrees: float = 79.0
    min_depth: float = 0.1
    max_depth: float = 10.0
    sweep_direction: str = "left"
    control_period: float = 0.05
    can_climb: bool = False
    views: list[str] = dc.field(default_factory=lambda: ["front"])
