"""What makes a quadrotor of a floating body: autopilot, rotors, propellers and the air."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant, Propeller, PropellerInfo
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder, System
from pydrake.systems.primitives import LinearSystem, MatrixGain

from unilavira_drake.robots.flight_autopilot import FlightAutopilot
from unilavira_drake.robots.flight_limits import Airframe, AutopilotGains
from unilavira_drake.robots.floating_base import FloatingBase
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.rotor_mixer import ROTOR_MOMENT, ROTOR_X, ROTOR_Y
from unilavira_drake.robots.wind import Wind, WindModel

STILL_AIR = WindModel()


def add_quadrotor_actuation(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: Quadrotor,
    *,
    wind: WindModel = STILL_AIR,
) -> None:
    """Adds the autopilot, rotors with lag, propellers, drag and wind, and exports the ports.

    ``base_command`` [x, y, z, yaw, vx, vy, vz] in; ``pose_estimate``, ``twist`` and
    ``cheat_X_WB`` out.  It takes the plant's ports for applied forces.

    Args:
        builder: of the station.
        plant: finalized, discrete.
        model_instance: the aircraft.
        robot: its configuration.
        wind: the air around it.
    """
    base = builder.AddSystem(FloatingBase())
    state = plant.get_state_output_port(model_instance)
    builder.Connect(state, base.GetInputPort("body_state"))
    autopilot = builder.AddNamedSystem(
        "autopilot",
        FlightAutopilot(
            airframe=airframe_of(plant, model_instance, robot),
            gains=AutopilotGains(max_tilt=math.radians(robot.max_tilt_degrees)),
            period=robot.autopilot_period,
        ),
    )
    builder.Connect(base.GetOutputPort("pose"), autopilot.GetInputPort("pose_estimate"))
    builder.Connect(base.GetOutputPort("twist"), autopilot.GetInputPort("twist"))
    _add_rotors(builder, plant, model_instance, robot, autopilot)
    _add_air(builder, plant, model_instance, robot, wind)
    builder.ExportInput(autopilot.GetInputPort("base_command"), "base_command")
    builder.ExportOutput(base.GetOutputPort("pose"), "pose_estimate")
    builder.ExportOutput(base.GetOutputPort("twist"), "twist")
    builder.ExportOutput(base.GetOutputPort("pose"), "cheat_X_WB")


def airframe_of(
    plant: MultibodyPlant, model_instance: ModelInstanceIndex, robot: Quadrotor
) -> Airframe:
    """Returns what the autopilot knows of the body: mass and inertia are those of the SDF."""
    body: Any = plant.GetBodyByName("base", model_instance)
    moments = body.default_rotational_inertia().get_moments()
    return Airframe(
        mass=body.default_mass(),
        inertia_x=float(moments[0]),
        inertia_y=float(moments[1]),
        inertia_z=float(moments[2]),
        rotor_offset=robot.rotor_arm / math.sqrt(2.0),
        moment_ratio=robot.rotor_moment_ratio,
        max_thrust=robot.rotor_thrust,
    )


def standing_pose(robot: Quadrotor, x: float, y: float, yaw: float) -> RigidTransform:
    """Returns X_WB of the aircraft standing on a floor at z = 0."""
    p_WB: Any = np.array([x, y, robot.standing_height])
    return RigidTransform(RotationMatrix.MakeZRotation(yaw), p_WB)


def _add_rotors(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: Quadrotor,
    autopilot: System,
) -> None:
    """Adds a first-order lag for each rotor, exact at the plant's steps, and the propellers."""
    step = plant.time_step()
    keep = math.exp(-step / robot.rotor_lag)
    one: Any = np.eye(4)
    rotors = builder.AddNamedSystem(
        "rotors", LinearSystem(keep * one, (1.0 - keep) * one, one, 0.0 * one, step)
    )
    builder.Connect(autopilot.GetOutputPort("rotor_command"), rotors.get_input_port())
    body = plant.GetBodyByName("base", model_instance).index()
    offset = robot.rotor_arm / math.sqrt(2.0)
    propellers = []
    for x, y, moment in zip(ROTOR_X, ROTOR_Y, ROTOR_MOMENT, strict=True):
        p_BP: Any = np.array([offset * x, offset * y, 0.0])
        ratio = moment * robot.rotor_moment_ratio
        propellers.append(PropellerInfo(body, RigidTransform(p_BP), 1.0, ratio))
    propeller: Any = builder.AddNamedSystem("propellers", Propeller(propellers))
    builder.Connect(rotors.get_output_port(), propeller.get_command_input_port())
    builder.Connect(plant.get_body_poses_output_port(), propeller.get_body_poses_input_port())
    builder.Connect(
        propeller.get_spatial_forces_output_port(), plant.get_applied_spatial_force_input_port()
    )


def _add_air(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: Quadrotor,
    model: WindModel,
) -> None:
    """Adds drag and wind as generalized forces: those of a floating body are [torque; force]."""
    wind = builder.AddSystem(
        Wind(
            model=model,
            linear_drag=robot.linear_drag,
            quadratic_drag=robot.quadratic_drag,
            period=robot.autopilot_period,
        )
    )
    builder.Connect(plant.get_state_output_port(model_instance), wind.GetInputPort("body_state"))
    body: Any = plant.GetBodyByName("base", model_instance)
    placement: Any = np.zeros((plant.num_velocities(), 6))
    first = body.floating_velocities_start_in_v()
    placement[first : first + 6] = np.eye(6)
    placed = builder.AddNamedSystem("wind_on_body", MatrixGain(placement))
    builder.Connect(wind.GetOutputPort("force"), placed.get_input_port())
    builder.Connect(placed.get_output_port(), plant.get_applied_generalized_force_input_port())
