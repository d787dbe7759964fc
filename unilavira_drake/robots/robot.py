"""What every robot says of itself; a robot is a dataclass of these numbers and one model file."""

import dataclasses as dc

from unilavira_drake.robots.gait_config import Gait


@dc.dataclass
class Robot:
    """Configuration that all robots share; the class's name is the scenario's tag.

    Lengths in metres, speeds in m/s and rad/s, accelerations in m/s^2 and rad/s^2.
    """

    name: str
    # Limits of the governor.
    max_speed: float
    max_yaw_rate: float
    max_acceleration: float
    max_yaw_acceleration: float
    # Footprint of the base.
    length: float
    width: float
    # Radius that the planner keeps free around the base's centre.
    radius: float
    # Radius swept when the base turns in place; goals keep this clearance where they can.
    turning_radius: float
    # Cameras: image size in pixels, horizontal field of view in degrees.
    image_width: int
    image_height: int
    horizontal_fov_degrees: float
    # Depth range of the cameras.
    min_depth: float
    max_depth: float
    # The side to which a robot with one camera turns to look around: left or right.
    sweep_direction: str
    # Period of controller and governor, seconds; a multiple of the plant's time step.
    control_period: float
    can_climb: bool
    # Cameras, each on a frame VIEW_camera of the model: front alone turns in place to look around,
    # a ring of front, left, back and right sees all at once.
    views: list[str]
    # The model: a file, or package://unilavira_drake/...; empty: robots/NAME.sdf of this package.
    model: str = ""
    # A view is captured below this speed and yaw rate.
    rest_speed: float = 0.03
    rest_rate: float = 0.03

    @property
    def leaves_the_ground(self) -> bool:
        """Whether it can be on another floor than the one at height 0."""
        return True

    @property
    def flies(self) -> bool:
        """Whether it is an aircraft."""
        return True


@dc.dataclass
class GroundRobot(Robot):
    """A robot that takes twists in the plane.

    Its model moves by the joints ``base_x``, ``base_y`` and ``base_yaw``, which carry the body
    ``base``.
    """

    # Whether the base moves sideways, and how fast.
    holonomic: bool = False
    max_lateral_speed: float = 0.2
    # The body takes a new command this often and holds it, seconds; 0: at once.
    command_period: float = 0.0
    # How trunk and legs swing, by the joints that robots/gait.py names; null: wheels.
    gait: Gait | None = None

    @property
    def leaves_the_ground(self) -> bool:
        """Whether it can be on another floor than the one at height 0."""
        return self.can_climb

    @property
    def flies(self) -> bool:
        """Whether it is an aircraft."""
        return False

    @property
    def hold(self) -> float:
        """How long a command is in force, seconds."""
        return max(self.control_period, self.command_period)
