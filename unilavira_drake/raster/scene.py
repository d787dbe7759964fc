"""A set of geometries on the graphics side, and how views of it are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message
from unilavira_drake.raster.batch import COMMAND, INSTANCE, shared_batch, vertex_array
from unilavira_drake.raster.culling import Pinhole, clip_matrix, frustum, visible
from unilavira_drake.raster.frames import Frame
from unilavira_drake.raster.geometry import Drawable
from unilavira_drake.raster.hiding import farthest, hidden
from unilavira_drake.raster.items import Call, Items
from unilavira_drake.raster.light import Light
from unilavira_drake.raster.shaders import exposure_block
from unilavira_drake.raster.stage import Stage, Target

_LINEAR_EXPONENT = 1.0 / 2.2

_LINEAR, _LINEAR_MIPMAP_NEAREST = 0x2601, 0x2701
_MAGNIFIED, _ANY_SIZE = (_LINEAR, _LINEAR), (_LINEAR_MIPMAP_NEAREST, _LINEAR)
"""OpenGL's filters of a picture that is smaller or larger in view.  To blend two of its sizes as
well costs a tenth more, and no difference is seen."""

_WORTH_HIDING = 4000
"""Triangles; with less to draw, looking for hidden ones costs more than drawing them."""


@dataclass(frozen=True)
class Exposure(Message):
    """How pictures are taken, beside the poses."""

    pinholes: tuple[Pinhole, ...]
    light: Light
    background: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class _View:
    """One view while it is drawn."""

    pinhole: Pinhole
    clip: NDArray[np.float64]
    seen: NDArray[np.int64]
    """Surfaces that are not outside the image."""
    magnified: NDArray[np.bool_] | None
    """Of all surfaces, which need no smaller pictures; None when depth alone is drawn."""


class Scene:
    """Some geometries, ready to be drawn.

    Args:
        stage: where.
        drawables: what.
    """

    def __init__(self, stage: Stage, drawables: Sequence[Drawable]) -> None:
        self._stage = stage
        # A memo of the last exposure: a picture is a function of poses.
        self._last: tuple[Any, tuple[Frame, ...]] = (None, ())
        self.frame_ids = list(dict.fromkeys(drawable.frame_id for drawable in drawables))
        number = {id_: index for index, id_ in enumerate(self.frame_ids)}
        self._frame_of = np.array([number[d.frame_id] for d in drawables], dtype=np.int64)
        self._X_FG = np.array([d.X_FG for d in drawables]).reshape(-1, 4, 4)
        models = {drawable.model.key: drawable.model for drawable in drawables}
        # Models live as long as a scene shows them.
        self._models = tuple(models.values())
        self._batch = shared_batch(stage, self._models)
        self._items = Items(drawables, self._batch)
        self._instances = np.zeros(max(len(drawables), 1), INSTANCE)
        for instance, drawable in zip(self._instances, drawables, strict=False):
            linear = any(surface.linear for surface in drawable.model.surfaces)
            instance["tint"] = (*drawable.color, _LINEAR_EXPONENT if linear else 1.0)
            instance["label"] = drawable.label
        with stage.current() as context:
            self._instance_buffer = context.buffer(reserve=self._instances.nbytes, dynamic=True)
            self._command_buffer = context.buffer(reserve=COMMAND.itemsize, dynamic=True)
        self._arrays = {
            defines: vertex_array(stage, program, self._batch, self._instance_buffer)
            for defines, program in stage.programs.items()
        }

    def draw(
        self,
        X_WF: NDArray[np.float64],
        X_WC: NDArray[np.float64],
        exposure: Exposure,
        *,
        colored: bool,
    ) -> tuple[Frame, ...]:
        """Returns the views of a rig.

        Args:
            X_WF: (m, 4, 4) poses of the frames in ``frame_ids``.
            X_WC: (k, 4, 4) pose of the camera in each view.
            exposure: pinhole of each view, light and background.
            colored: whether colour and label are wanted beside depth.
        """
        key = (exposure, X_WF.tobytes(), X_WC.tobytes())
        if self._last[0] == key and (self._last[1][0].color is not None or not colored):
            return self._last[1]
        frames = self._expose(X_WF, X_WC, exposure, colored=colored)
        self._last = (key, frames)
        return frames

    def _expose(
        self,
        X_WF: NDArray[np.float64],
        X_WC: NDArray[np.float64],
        exposure: Exposure,
        *,
        colored: bool,
    ) -> tuple[Frame, ...]:
        # Positions relative to the camera stay exact in single precision.
        origin = X_WC[0][:3, 3]
        rows = (X_WF[self._frame_of] @ self._X_FG)[:, :3, :]
        rows[:, :, 3] -= origin
        boxes = self._items.boxes(rows)
        with self._stage.current() as context:
            self._instances["rows"][: len(rows)] = rows
            self._instance_buffer.write(self._instances.view(np.uint8))
            context.enable_only(context.DEPTH_TEST)
            context.depth_func = "<="
            frames = []
            for pinhole, X in zip(exposure.pinholes, X_WC, strict=True):
                X_CW = _inverse(X, origin)
                clip = clip_matrix(pinhole) @ X_CW
                seen = np.flatnonzero(visible(frustum(clip), *boxes))
                magnified = self._items.magnified(seen, rows, X_CW, pinhole) if colored else None
                target = self._stage.target(pinhole.width, pinhole.height)
                (target.images if colored else target.depth).use()
                target.clear(exposure.background, colored=colored)
                self._stage.exposure.write(exposure_block(clip, pinhole, exposure.light))
                self._draw_view(
                    target, _View(pinhole, clip, seen, magnified), boxes, colored=colored
                )
                frames.append(_read(target, pinhole, colored=colored))
            return tuple(frames)

    def _draw_view(
        self,
        target: Target,
        view: _View,
        boxes: tuple[NDArray[np.float64], NDArray[np.float64]],
        *,
        colored: bool,
    ) -> None:
        """Draws large simple surfaces, then of the others what these do not hide."""
        screens = self._items.screens[view.seen]
        first, others = view.seen[screens], view.seen[~screens]
        if self._items.triangles[others].sum() < _WORTH_HIDING or len(first) == 0:
            self._draw(target, view, view.seen, boxes, colored=colored)
            return
        self._draw(target, view, first, boxes, colored=colored)
        tiles = farthest(_read_depth(target, view.pinhole, colored=colored))
        tiles = np.maximum(tiles, view.pinhole.min_depth)
        size = (view.pinhole.width, view.pinhole.height)
        behind = hidden(tiles, size, view.clip, boxes[0][others], boxes[1][others])
        self._draw(target, view, others[~behind], boxes, colored=colored)

    def _draw(
        self,
        target: Target,
        view: _View,
        chosen: NDArray[np.int64],
        boxes: tuple[NDArray[np.float64], NDArray[np.float64]],
        *,
        colored: bool,
    ) -> None:
        """Draws some surfaces."""
        if len(chosen) == 0:
            return
        depth = boxes[0][chosen] @ view.clip[3, :3] + view.clip[3, 3]
        magnified = None if view.magnified is None else view.magnified[chosen]
        order, calls = self._items.in_order(chosen, depth, magnified)
        commands = self._items.commands[order]
        self._command_buffer.orphan(commands.nbytes)
        self._command_buffer.write(commands.view(np.uint8))
        for call in calls:
            self._call(target, call, colored=colored)

    def _call(self, target: Target, call: Call, *, colored: bool) -> None:
        group = call.group
        holes = group.cutoff > 0.0
        defines = ("COLORED",) * colored + ("TEXTURED",) * bool(group.picture)
        defines += ("MASKED",) * holes
        if group.picture:
            texture = self._batch.textures[group.picture]
            texture.use(0)
            texture.filter = _MAGNIFIED if call.magnified else _ANY_SIZE
        if holes:
            self._stage.programs[defines]["cutoff"].value = group.cutoff
        if not group.labelled:
            target.mask_labels(True)
        self._arrays[defines].render_indirect(
            self._command_buffer, count=call.count, first=call.first
        )
        if not group.labelled:
            target.mask_labels(False)


def _inverse(X: NDArray[np.float64], origin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the inverse of a pose whose position is taken from another origin."""
    inverse = np.eye(4)
    inverse[:3, :3] = X[:3, :3].T
    inverse[:3, 3] = -X[:3, :3].T @ (X[:3, 3] - origin)
    return inverse


def _read_depth(target: Target, pinhole: Pinhole, *, colored: bool) -> NDArray[np.float32]:
    depth = np.empty((pinhole.height, pinhole.width), np.float32)
    images = target.images if colored else target.depth
    images.read_into(depth, None, 1, attachment=int(colored), dtype="f4")
    return depth


def _read(target: Target, pinhole: Pinhole, *, colored: bool) -> Frame:
    depth = _read_depth(target, pinhole, colored=colored)
    color = label = None
    if colored:
        color = np.empty((*depth.shape, 4), np.uint8)
        target.images.read_into(color, None, 4, attachment=0, alignment=1)
        label = np.empty(depth.shape, np.int16)
        target.images.read_into(label, None, 2, attachment=2, alignment=1)
    for image in (depth, color, label):
        if image is not None:
            image.flags.writeable = False
    return Frame(depth, color, label)
