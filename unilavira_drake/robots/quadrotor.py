"""A small quadrotor: rigid body, four propellers, five cameras or one that turns."""

import dataclasses as dc

from unilavira_drake.robots.robot import Robot


@dc.dataclass
class Quadrotor(Robot):
    """Configuration of the aircraft; the scenario tag is ``!Quadrotor``.

    Mass and inertia stand in the SDF.
    """

    name: str = "quadrotor"
    # Horizontal, up, down.
    max_speed: float = 1.0
    max_climb_speed: float = 0.8
    max_descent_speed: float = 0.6
    max_yaw_rate: float = 1.2
    max_acceleration: float = 1.5
    # With which the governor stops it; well below gravity times the tangent of the tilt.
    max_braking: float = 3.0
    max_yaw_acceleration: float = 4.0
    # The autopilot never tilts farther than this.
    max_tilt_degrees: float = 25.0
    # The body with its propellers.
    length: float = 0.38
    width: float = 0.38
    radius: float = 0.30
    turning_radius: float = 0.30
    # Height of the centre above the floor when it stands.
    standing_height: float = 0.12
    # From the centre to each rotor; each rotor's largest thrust in newtons and time constant in
    # seconds; yawing moment by thrust.
    rotor_arm: float = 0.16
    rotor_thrust: float = 7.5
    rotor_lag: float = 0.03
    rotor_moment_ratio: float = 0.016
    # Drag by air speed (N per m/s) and by its square.
    linear_drag: float = 0.25
    quadratic_drag: float = 0.03
    # Cameras: [front, left, back, right, down] see all round; [front, down] turns to look around.
    views: list[str] = dc.field(default_factory=lambda: ["front", "left", "back", "right", "down"])
    image_width: int = 640
    image_height: int = 480
    horizontal_fov_degrees: float = 90.0
    min_depth: float = 0.1
    max_depth: float = 40.0
    sweep_direction: str = "left"
    control_period: float = 0.05
    # Of the autopilot, seconds, and the longest step of the plant in which it flies.
    autopilot_period: float = 0.01
    max_time_step: float = 0.01
    # Wind moves it a little where it hovers.
    rest_speed: float = 0.2
    rest_rate: float = 0.1
    can_climb: bool = False
