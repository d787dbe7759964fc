"""What a raster camera is: its views, light and background."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pydrake.geometry import DepthRange, DepthRenderCamera, FrameId, RenderCameraCore
from pydrake.math import RigidTransform

from unilavira_drake.raster.culling import Pinhole
from unilavira_drake.raster.light import Light


@dataclass(frozen=True, eq=False)
class RasterView:
    """One view of a rig: a pinhole on a frame of the scene, for colour, depth and label alike."""

    parent_frame_id: FrameId
    """Frame P that carries the camera's body B."""
    X_PB: RigidTransform
    core: RenderCameraCore
    """Intrinsics, clipping range and X_BS, the pose of the sensor (x right, y down, z forward) in
    the camera's body.  Its renderer's name is used by the fallback alone."""
    depth_range: DepthRange
    name: str = ""
    """Prefix of the view's ports; empty for a rig of one view.

    Raises:
        RuntimeError: if the depth range leaves the clipping range (Drake's own check).
    """

    def __post_init__(self) -> None:
        # Refuses a depth range beyond the clipping range.
        DepthRenderCamera(self.core, self.depth_range)

    def pinhole(self) -> Pinhole:
        """Returns the camera model as plain numbers."""
        info, clipping = self.core.intrinsics(), self.core.clipping()
        return Pinhole(
            info.width(),
            info.height(),
            info.focal_x(),
            info.focal_y(),
            info.center_x(),
            info.center_y(),
            clipping.near(),
            clipping.far(),
            self.depth_range.min_depth(),
            self.depth_range.max_depth(),
        )

    def port(self, name: str) -> str:
        """Returns the full name of one of the view's ports."""
        return f"{self.name}.{name}" if self.name else name


@dataclass(frozen=True, eq=False)
class RasterCameraConfig:
    """A rig of one or several views of one scene.

    Raises:
        ValueError: if there is no view, or two have the same name.
    """

    views: tuple[RasterView, ...]
    light: Light = Light()
    background: tuple[float, float, float] = (0.8, 0.9, 1.0)
    """sRGB where nothing is seen."""
    fallback_lights: tuple[Any, ...] = ()
    """``LightParameter`` of Drake's VTK renderer where that has to do."""

    def __post_init__(self) -> None:
        names = [view.name for view in self.views]
        if not names or len(set(names)) < len(names) or (len(names) > 1 and "" in names):
            raise ValueError(f"views need names of their own: {names}")
