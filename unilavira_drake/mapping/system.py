"""The mapper: keeps the occupancy map up to date while the robot drives, turns and waits."""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F, ImageLabel16I

from unilavira_drake.mapping.depth_scan import FREE_STEP, warm_up
from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.moving_layer import with_moving
from unilavira_drake.mapping.moving_things import Look, MovingThing, remembered, wanted, without
from unilavira_drake.mapping.occupancy import NEWEST, MappingParameters, integrate
from unilavira_drake.mapping.stair_corridor import StairCorridor, corridor_at
from unilavira_drake.mapping.storeys import Storey, Storeys
from unilavira_drake.messages import (
    STAIR_KINDS,
    Goal,
    Intrinsics,
    Message,
    OccupancyMap,
    Panorama,
    read_only,
)
from unilavira_drake.ports import (
    Level,
    image_input,
    message_input,
    pixels,
    pose_input,
    pose_matrix,
    pose_numbers,
)

OLDEST_VIEW = 0.5
"""Where things move, older views of a panorama are not integrated, seconds."""
MOVING_FREE_STEP = 10
"""There a thing in a place that was never seen free is forgotten after so few looks."""
NOBODY = read_only(np.zeros((1, 1), np.int16))
"""The labels of what moves in a view where nothing is known to."""
SWAY = 0.1
"""Beside its footprint a robot on stairs needs so much room to keep to their axis, metres."""


@dc.dataclass(frozen=True)
class MapperState(Message):
    """The map, all storeys, and the pose and time of the latest integration."""

    occupancy: OccupancyMap = OccupancyMap()
    """Of the storey where the robot is, with the things that move."""
    storeys: Storeys = Storeys()
    """Without them."""
    things: tuple[MovingThing, ...] = ()
    """Those that move, as they are remembered."""
    position: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    time: float = -math.inf


class OccupancyMapper(Level):
    """Integrates every new panorama, and between panoramas the front depth image by motion.

    The map's ``n`` is the number of the latest panorama it holds.  A panorama re-issued under a
    new number (same frames) only renews ``n``.  The depth image is evaluated, and so rendered,
    only when the robot moved ``travel`` or turned ``turn`` since the last integration, or
    ``rest_period`` has passed; also while the observer sweeps.  Views that make no sense are left
    out; the map's ``rejected`` says why.

    Heights count from the plane on which the base stands, so slopes are floor to a robot that
    tilts with them.  ``map`` is that of the storey where the robot is; its version goes on counting
    when that is another one, see :mod:`unilavira_drake.mapping.storeys`.  While ``goal`` is a way
    over stairs and the robot is on it, steps are a free corridor, and only what stands in the
    corridor is an obstacle, see :mod:`unilavira_drake.mapping.stair_corridor`.

    .. pydrake_system::

        name: OccupancyMapper
        input_ports:
        - panorama
        - front.depth_image
        - front.X_BC
        - pose_estimate
        - goal (optional)
        - front.label_image (where labels that move are given)
        output_ports:
        - map

    Args:
        intrinsics: the front camera.
        resolution: side of a cell, metres.
        max_range: horizontal range up to which depth counts, metres.
        min_height: lowest obstacle above the floor, metres.
        max_height: highest obstacle above the floor, metres.
        footprint_radius: unknown floor this near to the base is free, metres.
        stride: every so many rows and columns of the image are read.
        travel: metres between two integrations.
        turn: radians between two integrations.
        saturation: readings from here on are none, metres.
        rest_period: seconds between two integrations at rest.
        moving: whether things move about, see ``MappingParameters.newest``.
        moving_labels: render labels of things that are known to move, as a detector of people would
            tell; with ``moving``.
        base_height: height of the base frame's origin above the floor, metres.
        period: seconds between two polls.
    """

    def __init__(
        self,
        *,
        intrinsics: Intrinsics,
        resolution: float = 0.05,
        max_range: float = 5.0,
        min_height: float = 0.10,
        max_height: float = 1.40,
        footprint_radius: float = 0.36,
        stride: int = 2,
        saturation: float = math.inf,
        travel: float = 0.15,
        turn: float = math.radians(15.0),
        rest_period: float = 2.0,
        moving: bool = False,
        moving_labels: Sequence[int] = (),
        base_height: float = 0.0,
        period: float = 0.1,
    ) -> None:
        super().__init__(MapperState(), period=period)
        self._intrinsics = intrinsics
        self._parameters = MappingParameters(
            resolution=resolution,
            max_range=max_range,
            min_height=min_height,
            max_height=max_height,
            footprint_radius=footprint_radius,
            stride=stride,
            free_step=MOVING_FREE_STEP if moving else FREE_STEP,
            newest=NEWEST if moving else 0,
            saturation=saturation,
        )
        # Where things move, a view of the past would put them back; what it showed of the rest was
        # integrated while the robot turned.
        self._oldest = OLDEST_VIEW if moving else math.inf
        self._travel = travel
        self._turn = turn
        self._rest_period = rest_period
        self._base_height = base_height
        self._panorama = message_input(self, "panorama", Panorama())
        self._depth_image = image_input(self, "front.depth_image", ImageDepth32F)
        self._X_BC = pose_input(self, "front.X_BC")
        self._pose = pose_input(self, "pose_estimate")
        self._goal = message_input(self, "goal", Goal())
        self._moves = wanted(moving_labels)
        self._label_image = (
            image_input(self, "front.label_image", ImageLabel16I) if moving_labels else None
        )
        self.declare_output("map", lambda state: state.occupancy, OccupancyMap())
        warm_up()

    def storeys(self, context: Context) -> tuple[Storey, ...]:
        """Returns the maps of all storeys, in the order in which they were found."""
        state: MapperState = self.state(context)
        return state.storeys.known

    def step(self, context: Context, state: Any) -> Any:
        """Returns the state after the newest panorama or depth image; see the class."""
        panorama = self._panorama(context)
        pose = self._pose(context)
        if panorama.n <= state.occupancy.n and not self._due(context.get_time(), state, pose):
            return state
        X_WB = pose_matrix(pose)
        if panorama.first > state.occupancy.n:
            oldest = context.get_time() - self._oldest
            frames = [frame for frame in panorama.frames if frame.time >= oldest]
            looks = tuple(
                Look(DepthView.of(frame), self._moving(frame.label), frame.time) for frame in frames
            )
            return self._integrated(context, state, X_WB, panorama.X_WB, looks, panorama.n)
        if panorama.n > state.occupancy.n:
            occupancy = dc.replace(state.occupancy, n=panorama.n)
            return dc.replace(state, occupancy=occupancy)
        image = self._depth_image(context)
        X_WC = pose_matrix(pose @ self._X_BC(context))
        view = DepthView(pixels(image)[:, :, 0], self._intrinsics, X_WC)
        corridor = self._corridor(context, state, X_WB)
        if corridor is not None:
            view = corridor.seen(view)
            state = _freed(state, corridor)
        reader = self._label_image
        labels = NOBODY if reader is None else self._moving(pixels(reader(context))[:, :, 0])
        looks = (Look(view, labels, context.get_time()),)
        return self._integrated(context, state, X_WB, X_WB, looks, state.occupancy.n)

    def _corridor(
        self, context: Context, state: MapperState, X_WB: NDArray[np.float64]
    ) -> StairCorridor | None:
        """Returns the stairs on which the robot is; None while it is on none."""
        goal = self._goal.optional(context)
        if goal is None or goal.kind not in STAIR_KINDS.values() or goal.n != state.occupancy.n:
            return None
        width = self._parameters.footprint_radius + SWAY
        place = (float(X_WB[0, 3]), float(X_WB[1, 3]), float(X_WB[2, 3]) - self._base_height)
        level = state.storeys.level_travel(place)
        return corridor_at(goal, place, half_width=width, level=level)

    def _moving(self, labels: NDArray[np.int16]) -> NDArray[np.int16]:
        """Returns the labels of what moves, 0 elsewhere."""
        if self._label_image is None:
            return NOBODY
        moving: NDArray[np.int16] = self._moves[labels]
        return moving

    def _due(self, time: float, state: MapperState, pose: RigidTransform) -> bool:
        if time - state.time >= self._rest_period - 1e-9:
            return True
        X_WB = pose_numbers(pose)
        if not all(map(math.isfinite, X_WB)):
            return False
        if math.dist((X_WB[3], X_WB[7]), state.position) >= self._travel:
            return True
        yaw = math.atan2(X_WB[4], X_WB[0])
        return abs(math.remainder(yaw - state.yaw, math.tau)) >= self._turn

    def _integrated(
        self,
        context: Context,
        state: MapperState,
        X_WB: NDArray[np.float64],
        X_WB_seen: NDArray[np.float64],
        looks: tuple[Look, ...],
        n: int,
    ) -> MapperState:
        """Returns the state after looks that were taken when the base was at ``X_WB_seen``."""
        time, position = context.get_time(), (float(X_WB[0, 3]), float(X_WB[1, 3]))
        up = (float(X_WB_seen[0, 2]), float(X_WB_seen[1, 2]), float(X_WB_seen[2, 2]))
        floor_height = float(X_WB_seen[2, 3]) - self._base_height / max(up[2], 0.5)
        storeys = state.storeys.at(floor_height, position)
        occupancy = integrate(
            storeys.occupancy,
            tuple(without(look) for look in looks),
            parameters=self._parameters,
            position=position,
            floor_height=floor_height,
            n=n,
            time=time,
            up=up,
        )
        if occupancy.version == storeys.occupancy.version:
            # Nothing could be believed; motion is measured from the last pose that was one.
            occupancy = dc.replace(state.occupancy, n=n, rejected=occupancy.rejected)
            return dc.replace(state, occupancy=occupancy, time=time)
        # The versions of all storeys are one count.
        occupancy = dc.replace(occupancy, version=state.occupancy.version + 1)
        storeys, things = storeys.mapped(occupancy), state.things
        if self._label_image is not None:
            things = remembered(
                things,
                looks,
                self._parameters,
                robot=position,
                floor_height=floor_height,
                time=time,
            )
            occupancy = with_moving(occupancy, things, self._parameters, floor_height)
        return MapperState(occupancy, storeys, things, position, _yaw(X_WB), time)


def _freed(state: MapperState, corridor: StairCorridor) -> MapperState:
    """Returns the state with the cells of the stairs around the robot free."""
    here = state.storeys.occupancy
    if here.version == 0:
        return state
    return dc.replace(state, storeys=state.storeys.mapped(corridor.freed(here)))


def _yaw(X_WB: NDArray[np.float64]) -> float:
    return math.atan2(X_WB[1, 0], X_WB[0, 0])
