"""Draws what a query object sees."""

from __future__ import annotations

import copy
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import GeometryVersion, QueryObject, Role, SceneGraphInspector

from unilavira_drake.ports import pose_matrix
from unilavira_drake.raster import culling, hiding
from unilavira_drake.raster.config import RasterCameraConfig
from unilavira_drake.raster.frames import Frame
from unilavira_drake.raster.geometry import perception_ids, read_drawables
from unilavira_drake.raster.scene import Exposure, Scene
from unilavira_drake.raster.stage import Stage

_ROLES = (Role.kPerception, Role.kIllustration, Role.kProximity)


class _Key:
    """What a scene graph holds: a list of ids that is hashed once, and its version.

    Without a render engine the version knows nothing of the perception role; so ids are compared,
    and the other roles tell of a shape that changed under its id.
    """

    def __init__(self, names: list[Any], version: GeometryVersion) -> None:
        self._names = names
        self._version = version
        self._hash = hash(tuple(names))

    def says(self, names: list[Any], version: GeometryVersion) -> bool:
        """Whether these are the ids and the version."""
        return self._names == names and all(version.IsSameAs(self._version, r) for r in _ROLES)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, _Key) and self.says(other._names, other._version)
        )


class RasterRenderer:
    """Pictures as a function of geometries and poses.

    It owns nothing on the graphics side: scenes are the stage's, and can be made anew.

    Args:
        stage: where to draw.
        config: what to take pictures with.
    """

    def __init__(self, stage: Stage, config: RasterCameraConfig) -> None:
        self._stage = stage
        self._views = config.views
        self._X_PS = [
            pose_matrix(view.X_PB.multiply(view.core.sensor_pose_in_camera_body()))
            for view in config.views
        ]
        pinholes = tuple(view.pinhole() for view in config.views)
        self._key: _Key | None = None
        # Held by the stage, for as long as it has room.
        self._scene: Callable[[], Scene | None] = lambda: None
        culling.warm_up()
        hiding.warm_up()
        self._exposure = Exposure(pinholes, config.light, config.background)

    def scene(self, inspector: SceneGraphInspector) -> Scene:
        """Returns the scene of what has the perception role now.

        Raises:
            GeometryError: naming the geometry, if one cannot be drawn.
        """
        ids = perception_ids(inspector)
        # One GeometryInstance may stand in several scene graphs, with one id; a source may not.
        names = [*inspector.GetAllSourceIds(), *ids]
        version = inspector.geometry_version()
        known = self._scene()
        if known is not None and self._key is not None and self._key.says(names, version):
            return known
        self._key = _Key(names, copy.copy(version))
        scene: Scene = self._stage.scenes.get(
            self._key, lambda: Scene(self._stage, read_drawables(inspector, ids))
        )
        self._scene = weakref.ref(scene)
        return scene

    def draw(self, query: QueryObject, *, colored: bool) -> tuple[Frame, ...]:
        """Returns one frame per view.

        Args:
            query: of the scene graph.
            colored: whether colour and label are wanted beside depth.
        """
        scene = self.scene(query.inspector())
        X_WF = np.array([_pose(query, id_) for id_ in scene.frame_ids]).reshape(-1, 4, 4)
        X_WC = np.array(
            [
                _pose(query, view.parent_frame_id) @ X_PS
                for view, X_PS in zip(self._views, self._X_PS, strict=True)
            ]
        )
        return scene.draw(X_WF, X_WC, self._exposure, colored=colored)


def _pose(query: QueryObject, frame_id: Any) -> NDArray[np.float64]:
    return pose_matrix(query.GetPoseInWorld(frame_id))
