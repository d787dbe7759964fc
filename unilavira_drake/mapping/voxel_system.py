"""The voxel mapper: keeps the 3-D map up to date while an aircraft flies, turns and hovers."""

from __future__ import annotations

import dataclasses as dc
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.mapping import voxels_carving, voxels_queries
from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.voxels import VoxelParameters, integrate_voxels
from unilavira_drake.messages import Intrinsics, Message, Panorama, VoxelMap, read_only
from unilavira_drake.ports import (
    Level,
    image_input,
    message_input,
    pixels,
    pose_input,
    pose_matrix,
)


@dc.dataclass(frozen=True, eq=False)
class VoxelMapperState(Message):
    """The map, and the pose and time of the latest integration."""

    voxels: VoxelMap = dc.field(default_factory=VoxelMap)
    X_WB: NDArray[np.float64] = dc.field(default_factory=lambda: read_only(np.eye(4)))
    time: float = -math.inf


class VoxelMapper(Level):
    """Integrates every new panorama, and between panoramas the depth images by motion.

    The map's ``n`` is the number of the latest panorama it holds.  A panorama re-issued under a
    new number (same frames) only renews ``n``.  Depth images are evaluated, and so rendered, only
    when the aircraft moved ``travel`` or turned ``turn`` since the last integration, or
    ``rest_period`` has passed.  Views that make no sense are left out; the map's ``rejected``
    says why.

    .. pydrake_system::

        name: VoxelMapper
        input_ports:
        - panorama
        - '{view}.depth_image'
        - '{view}.X_BC'
        - pose_estimate
        output_ports:
        - voxel_map

    Args:
        intrinsics: of each camera, by the name of its view; gives each a pair of ports.
        resolution: side of a voxel, metres.
        max_range: distance from the camera up to which depth counts, metres.
        saturation: readings from here on are none, metres.
        far_is_free: whether a reading of inf says that nothing lies within the range.
        stride: every so many rows and columns of an image are read.
        travel: metres between two integrations.
        turn: radians between two integrations, about any axis.
        rest_period: seconds between two integrations at rest.
        min_altitude: lowest z of the aircraft's centre in the world, metres; the map tells it.
        max_altitude: highest z of its centre in the world, metres; the map tells it.
        period: seconds between two polls.

    Raises:
        ValueError: if a number makes no sense, or the range has too many voxels.
    """

    def __init__(
        self,
        *,
        intrinsics: Mapping[str, Intrinsics],
        resolution: float = 0.5,
        max_range: float = 40.0,
        saturation: float = math.inf,
        far_is_free: bool = False,
        stride: int = 4,
        travel: float = 0.5,
        turn: float = math.radians(15.0),
        rest_period: float = 2.0,
        min_altitude: float = 1.0,
        max_altitude: float = 60.0,
        period: float = 0.1,
    ) -> None:
        empty = VoxelMap(resolution=resolution, altitudes=(min_altitude, max_altitude))
        super().__init__(VoxelMapperState(empty), period=period)
        self._parameters = VoxelParameters(
            resolution=resolution,
            max_range=max_range,
            saturation=saturation,
            far_is_free=far_is_free,
            stride=stride,
        )
        self._travel = travel
        self._turn = turn
        self._rest_period = rest_period
        self._panorama = message_input(self, "panorama", Panorama())
        self._cameras = tuple(
            (
                lens,
                image_input(self, f"{view}.depth_image", ImageDepth32F),
                pose_input(self, f"{view}.X_BC"),
            )
            for view, lens in intrinsics.items()
        )
        self._pose = pose_input(self, "pose_estimate")
        self.declare_output("voxel_map", lambda state: state.voxels, empty)
        voxels_carving.warm_up()
        voxels_queries.warm_up()

    def step(self, context: Context, state: Any) -> Any:
        """Returns the state after the newest panorama or depth images; see the class."""
        panorama = self._panorama(context)
        X_WB = pose_matrix(self._pose(context))
        if panorama.first > state.voxels.n:
            views = [DepthView.of(frame) for frame in panorama.frames]
            return self._integrated(context, state, X_WB, views, panorama.n)
        if panorama.n > state.voxels.n:
            return dc.replace(state, voxels=dc.replace(state.voxels, n=panorama.n))
        if not self._due(context.get_time(), state, X_WB):
            return state
        views = []
        for lens, depth_image, X_BC in self._cameras:
            with np.errstate(invalid="ignore", over="ignore"):
                X_WC = X_WB @ pose_matrix(X_BC(context))
            views.append(DepthView(pixels(depth_image(context))[:, :, 0], lens, X_WC))
        return self._integrated(context, state, X_WB, views, state.voxels.n)

    def _due(self, time: float, state: VoxelMapperState, X_WB: NDArray[np.float64]) -> bool:
        if not self._cameras:
            return False
        if time - state.time >= self._rest_period - 1e-9:
            return True
        if not np.isfinite(X_WB).all():
            return False
        if math.dist(X_WB[:3, 3], state.X_WB[:3, 3]) >= self._travel:
            return True
        cosine = 0.5 * (float(np.sum(X_WB[:3, :3] * state.X_WB[:3, :3])) - 1.0)
        return math.acos(min(max(cosine, -1.0), 1.0)) >= self._turn

    def _integrated(
        self,
        context: Context,
        state: VoxelMapperState,
        X_WB: NDArray[np.float64],
        views: list[DepthView],
        n: int,
    ) -> VoxelMapperState:
        time = context.get_time()
        voxels = integrate_voxels(state.voxels, views, parameters=self._parameters, n=n, time=time)
        # Motion is measured from the last pose that was one.
        pose = read_only(X_WB) if np.isfinite(X_WB).all() else state.X_WB
        return VoxelMapperState(voxels, pose, time)
