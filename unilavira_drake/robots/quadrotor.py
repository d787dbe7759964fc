"""A small quadrotor: rigid body, four propellers, five cameras or one that turns."""

import dataclasses as dc


@dc.dataclass
class Quadrotor:
    """Configuration of the aircraft; the scenario tag is ``!Quadrotor``.

    Lengths in metres, speeds in m/s and rad/s, accelerations in m/s^2 and rad/s^2.  Mass and
    inertia stand in the SDF.
    """

    name: str = "quadrotor"
    # Limits of controller and governor: horizontal, up, down.
    max_speed: float = 1.0
    max_climb_speed: float = 0.8
    max_descent_speed: float = 0.6
    max_yaw_rate: float = 1.2
    max_acceleration: float = 1.5
    max_yaw_acceleration: float = 4.0
    # The autopilot never tilts farther than this.
    max_tilt_degrees: float = 25.0
    # The body with its propellers.
    length: float = 0.38
    width: float = 0.38
    # Radius that the planner keeps free around the centre.
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
    # Each camera: image size in pixels, horizontal field of view in degrees.
    image_width: int = 640
    image_height: int = 480
    horizontal_fov_degrees: float = 90.0
    # Depth range of the cameras.
    min_depth: float = 0.1
    max_depth: float = 40.0
    # The side to which it turns to look around with one camera: left or right.
    sweep_direction: str = "left"
    # Period of controller and governor, and of the autopilot, seconds; multiples of the plant's
    # time step.
    control_period: float = 0.05
    autopilot_period: float = 0.01
    can_climb: bool = False
