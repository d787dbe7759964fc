"""What makes a quadrotor of a floating body: autopilot, rotors, propellers and the air."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    CoulombFriction,
    MultibodyPlant,
    Propeller,
    PropellerInfo,
)
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort, System
from pydrake.systems.primitives import LinearSystem, MatrixGain

from unilavira_drake.robots.flight_autopilot import FlightAutopilot
from unilavira_drake.robots.flight_limits import GRAVITY, Airframe, AutopilotGains
from unilavira_drake.robots.floating_base import FloatingBase
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.rotor_mixer import ROTOR_MOMENT, ROTOR_X, ROTOR_Y
from unilavira_drake.robots.wind import STILL_AIR, Wind, WindModel

GROUND_SIDE = 4000.0
"""Metres."""


def add_quadrotor_actuation(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: Quadrotor,
    *,
    wind: WindModel = STILL_AIR,
) -> tuple[OutputPort, OutputPort, InputPort]:
    """Adds the autopilot, rotors with lag, propellers, drag and wind.

    Exports the input ``base_command`` [x, y, z, yaw, vx, vy, vz].  It takes the plant's ports for
    applied forces.

    Args:
        builder: of the station.
        plant: finalized, discrete.
        model_instance: the aircraft.
        robot: its configuration.
        wind: the air around it.

    Returns:
        The ports of the true pose X_WB and of the twist, and the autopilot's for its pose estimate.
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
    builder.Connect(base.GetOutputPort("twist"), autopilot.GetInputPort("twist"))
    _add_rotors(builder, plant, model_instance, robot, autopilot)
    _add_air(builder, plant, model_instance, robot, wind)
    builder.ExportInput(autopilot.GetInputPort("base_command"), "base_command")
    estimate = autopilot.GetInputPort("pose_estimate")
    return base.GetOutputPort("pose"), base.GetOutputPort("twist"), estimate


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


def add_landing_ground(plant: MultibodyPlant) -> None:
    """Adds ground at z = 0 to stand on, which nobody sees; a robot on wheels needs none."""
    p_WG: Any = np.array([0.0, 0.0, -0.5])
    slab = Box(GROUND_SIDE, GROUND_SIDE, 1.0)
    friction = CoulombFriction(0.9, 0.8)
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform(p_WG), slab, "landing_ground", friction
    )


def set_flight_start(
    plant: MultibodyPlant,
    model_instance: ModelInstanceIndex,
    robot: Quadrotor,
    start: tuple[float, float, float],
    height: float = 0.0,
) -> None:
    """Sets the default pose: in the air, or standing on a floor at z = 0.

    Args:
        plant: finalized.
        model_instance: the aircraft.
        robot: its configuration.
        start: x, y (metres) and yaw (radians).
        height: of the centre, metres; it stands where that is lower than its skids.
    """
    x, y, yaw = start
    p_WB: Any = np.array([x, y, max(height, robot.standing_height)])
    X_WB = RigidTransform(RotationMatrix.MakeZRotation(yaw), p_WB)
    plant.SetDefaultFloatingBaseBodyPose(plant.GetBodyByName("base", model_instance), X_WB)


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
    lag = LinearSystem(keep * one, (1.0 - keep) * one, one, 0.0 * one, step)
    base: Any = plant.GetBodyByName("base", model_instance)
    height = plant.GetDefaultFloatingBaseBodyPose(base).translation()[2]
    if height > robot.standing_height + 0.01:
        hover: Any = np.full(4, 0.25 * base.default_mass() * GRAVITY)
        lag.configure_default_state(hover)
    rotors = builder.AddNamedSystem("rotors", lag)
    builder.Connect(autopilot.GetOutputPort("rotor_command"), rotors.get_input_port())
    offset = robot.rotor_arm / math.sqrt(2.0)
    propellers = []
    for x, y, moment in zip(ROTOR_X, ROTOR_Y, ROTOR_MOMENT, strict=True):
        p_BP: Any = np.array([offset * x, offset * y, 0.0])
        ratio = moment * robot.rotor_moment_ratio
        propellers.append(PropellerInfo(base.index(), RigidTransform(p_BP), 1.0, ratio))
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
            period=2.0 * robot.autopilot_period,
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
