"""What moves a robot: one function for each kind of body."""

from __future__ import annotations

from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder, System

from unilavira_drake.robots.ground_actuation import add_ground_actuation, set_ground_start
from unilavira_drake.robots.localization_config import PoseEstimateConfig
from unilavira_drake.robots.pose_estimator import PoseEstimator
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.quadrotor_actuation import add_quadrotor_actuation, set_flight_start
from unilavira_drake.robots.robot import GroundRobot, Robot
from unilavira_drake.robots.terrain import GroundHeight
from unilavira_drake.robots.wind import STILL_AIR, WindModel


def add_actuation(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: Robot,
    *,
    locomotion: System | None = None,
    localization: PoseEstimateConfig | None = None,
    seed: int = 0,
    ground_height: GroundHeight | None = None,
    wind: WindModel = STILL_AIR,
) -> None:
    """Adds what turns ``base_command`` into motion, and says where the robot is.

    Exports the input ``base_command`` and the outputs ``pose_estimate``, ``twist`` and
    ``cheat_X_WB`` of the Diagram that is built; with an error of the estimate also the input
    ``recalibrations``.

    Args:
        builder: of the station.
        plant: finalized.
        model_instance: of the robot.
        robot: its type chooses the kind of actuation.
        locomotion: a System of the user's own in the place of ours, with its ports: a gait policy,
            a whole-body controller.
        localization: the error of the pose estimate; none when None.
        seed: of that error.
        ground_height: of the world, for a robot that climbs.
        wind: that pushes aircraft.

    Raises:
        TypeError: if nothing is known to move such a robot.
        ScenarioError: if it is given a gait whose joints its model lacks.
    """
    if isinstance(robot, GroundRobot):
        X_WB, twist = add_ground_actuation(
            builder, plant, model_instance, robot, locomotion, ground_height
        )
        believing = None
    elif isinstance(robot, Quadrotor):
        X_WB, twist, believing = add_quadrotor_actuation(
            builder, plant, model_instance, robot, wind=wind
        )
    else:
        raise TypeError(_unknown(robot))
    builder.ExportOutput(X_WB, "cheat_X_WB")
    builder.ExportOutput(twist, "twist")
    estimate = X_WB
    if localization is not None and not localization.exact:
        estimator = builder.AddSystem(PoseEstimator(config=localization, seed=seed))
        builder.Connect(X_WB, estimator.GetInputPort("X_WB"))
        builder.Connect(twist, estimator.GetInputPort("twist"))
        builder.ExportInput(estimator.GetInputPort("recalibrations"), "recalibrations")
        estimate = estimator.GetOutputPort("pose_estimate")
    if believing is not None:
        builder.Connect(estimate, believing)
    builder.ExportOutput(estimate, "pose_estimate")


def set_start(
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: Robot,
    start: tuple[float, float, float],
    height: float = 0.0,
) -> None:
    """Sets the default pose of a robot.

    Args:
        plant: finalized.
        model_instance: of the robot.
        robot: its type chooses what is set.
        start: x, y (metres) and yaw (radians).
        height: of the floor at the start, metres; of an aircraft, which may start above it.

    Raises:
        TypeError: as ``add_actuation``.
    """
    if isinstance(robot, GroundRobot):
        set_ground_start(plant, model_instance, start, height)
    elif isinstance(robot, Quadrotor):
        set_flight_start(plant, model_instance, robot, start, height)
    else:
        raise TypeError(_unknown(robot))


def _unknown(robot: Robot) -> str:
    return f"nothing moves a {type(robot).__name__}; derive it from GroundRobot or Quadrotor"
