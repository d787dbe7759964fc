"""Agilex Cobot Magic: a differential base with a chest camera."""

import dataclasses as dc


@dc.dataclass
class CobotMagic:
    """Configuration of the robot; the scenario tag is ``!CobotMagic``.

    Lengths in metres, speeds in m/s and rad/s, accelerations in m/s^2 and rad/s^2.
    """

    name: str = "cobot_magic"
    # Limits of the governor; below the base's own 1.8 m/s.
    max_speed: float = 0.8
    max_yaw_rate: float = 1.5
    max_acceleration: float = 1.0
    max_yaw_acceleration: float = 3.0
    # Footprint of the base.
    length: float = 0.69
    width: float = 0.57
    # Radius that the planner keeps free around the base's centre.
    radius: float = 0.36
    # Radius swept when the base turns in place; goals keep this clearance where they can.
    turning_radius: float = 0.52
    # Front camera: image size in pixels, horizontal field of view in degrees.
    image_width: int = 640
    image_height: int = 480
    horizontal_fov_degrees: float = 79.0
    # Depth range of the camera.
    min_depth: float = 0.1
    max_depth: float = 10.0
    # The side to which the robot turns to look around: left or right.
    sweep_direction: str = "left"
    # Period of controller and governor, seconds; a multiple of the plant's time step.
    control_period: float = 0.05
    can_climb: bool = False
