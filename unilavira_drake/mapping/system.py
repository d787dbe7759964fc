"""The mapper: keeps the occupancy map up to date while the robot drives, turns and waits."""

from __future__ import annotations

import dataclasses as dc
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.mapping.depth_scan import warm_up
from unilavira_drake.mapping.occupancy import DepthView, MappingParameters, integrate
from unilavira_drake.messages import Intrinsics, Message, OccupancyMap, Panorama
from unilavira_drake.ports import Level, image_input, message_input, pose_input


@dc.dataclass(frozen=True)
class MapperState(Message):
    """The map, and the pose and time of the latest integration."""

    occupancy: OccupancyMap = OccupancyMap()
    position: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    time: float = -math.inf


class OccupancyMapper(Level):
    """Integrates every new panorama, and between panoramas the front depth image by motion.

    The map's ``n`` is the number of the latest panorama it holds.  A panorama re-issued under a
    new number (same frames) only renews ``n``.  The depth image is evaluated, and so rendered,
    only when the robot moved ``travel`` or turned ``turn`` since the last integration, or
    ``rest_period`` has passed; also while the observer sweeps.

    .. pydrake_system::

        name: OccupancyMapper
        input_ports:
        - panorama
        - front.depth_image
        - front.X_BC
        - pose_estimate
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
        rest_period: seconds between two integrations at rest.
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
        travel: float = 0.15,
        turn: float = math.radians(15.0),
        rest_period: float = 2.0,
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
        )
        self._travel = travel
        self._turn = turn
        self._rest_period = rest_period
        self._base_height = base_height
        self._panorama = message_input(self, "panorama", Panorama())
        self._depth_image = image_input(self, "front.depth_image", ImageDepth32F)
        self._X_BC = pose_input(self, "front.X_BC")
        self._pose = pose_input(self, "pose_estimate")
        self.declare_output("map", lambda state: state.occupancy, OccupancyMap())
        warm_up()

    def step(self, context: Context, state: Any) -> Any:
        """Returns the state after the newest panorama or depth image; see the class."""
        panorama = self._panorama(context)
        X_WB = self._pose(context)
        if panorama.first > state.occupancy.n:
            views = tuple(DepthView.of(frame) for frame in panorama.frames)
            floor_height = panorama.position[2] - self._base_height
            return self._integrated(context, state, X_WB, views, panorama.n, floor_height)
        if panorama.n > state.occupancy.n:
            occupancy = dc.replace(state.occupancy, n=panorama.n)
            return dc.replace(state, occupancy=occupancy)
        if not self._due(context.get_time(), state, X_WB):
            return state
        image = self._depth_image(context)
        X_WC = (X_WB @ self._X_BC(context)).GetAsMatrix4()
        pixels: Any = image.data
        depth: NDArray[np.float32] = pixels[:, :, 0]
        floor_height = float(X_WB.translation()[2]) - self._base_height
        views = (DepthView(depth, self._intrinsics, X_WC),)
        return self._integrated(context, state, X_WB, views, state.occupancy.n, floor_height)

    def _due(self, time: float, state: MapperState, X_WB: RigidTransform) -> bool:
        if time - state.time >= self._rest_period - 1e-9:
            return True
        x, y, _ = X_WB.translation()
        if math.hypot(x - state.position[0], y - state.position[1]) >= self._travel:
            return True
        return abs(math.remainder(_yaw(X_WB) - state.yaw, math.tau)) >= self._turn

    def _integrated(
        self,
        context: Context,
        state: MapperState,
        X_WB: RigidTransform,
        views: tuple[DepthView, ...],
        n: int,
        floor_height: float,
    ) -> MapperState:
        x, y, _ = X_WB.translation()
        position = (float(x), float(y))
        occupancy = integrate(
            state.occupancy,
            views,
            parameters=self._parameters,
            position=position,
            floor_height=floor_height,
            n=n,
            time=context.get_time(),
        )
        return MapperState(occupancy, position, _yaw(X_WB), context.get_time())


def _yaw(X_WB: RigidTransform) -> float:
    R = X_WB.rotation().matrix()
    return math.atan2(R[1, 0], R[0, 0])
