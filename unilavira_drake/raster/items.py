"""The surfaces of a scene as a table: what to draw for a view, and in which order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.messages import Message
from unilavira_drake.raster.batch import COMMAND, Batch, bounds
from unilavira_drake.raster.culling import Pinhole
from unilavira_drake.raster.geometry import Drawable
from unilavira_drake.raster.magnifying import facets_of, magnified

_SCREEN_TRIANGLES = 50
_SCREEN_HALF_SIZE = 1.0
_FAR = 1e9


@dataclass(frozen=True)
class Group(Message):
    """Surfaces that one draw call can take."""

    labelled: bool
    cutoff: float
    """Of alpha; 0 where there are no holes."""
    picture: str
    """Key of the texture; empty where none is needed."""


@dataclass(frozen=True)
class Call(Message):
    """A draw call: commands in a row."""

    group: Group
    magnified: bool
    """Whether the picture's full size is enough."""
    first: int
    count: int


class Items:
    """Each surface of each geometry.

    Args:
        drawables: the geometries.
        batch: where their triangles are.
    """

    def __init__(self, drawables: Sequence[Drawable], batch: Batch) -> None:
        colored, commands, boxes = [], [], []
        for index, drawable in enumerate(drawables):
            ranges = batch.ranges[drawable.model.key]
            for surface, part in zip(drawable.model.surfaces, ranges, strict=True):
                picture = surface.texture.key if surface.texture else ""
                cutoff = surface.alpha_cutoff if picture else 0.0
                colored.append(Group(drawable.labelled, cutoff, picture))
                commands.append((part.count, 1, part.first_index, part.base_vertex, index))
                boxes.append(bounds(surface))
        plain = [
            Group(True, group.cutoff, group.picture if group.cutoff else "") for group in colored
        ]
        self._groups = {True: _numbered(colored), False: _numbered(plain)}
        # Geometries without a label come last, over those that have one.
        self._last = {
            key: np.array([0.0 if group.labelled else _FAR for group in groups])
            for key, (groups, _) in self._groups.items()
        }
        self.commands = np.array(commands, dtype=COMMAND)
        self.triangles = self.commands["count"].astype(np.int64) // 3
        self._middles = np.array([middle for middle, _ in boxes]).reshape(-1, 3)
        self._halves = np.array([half for _, half in boxes]).reshape(-1, 3)
        simple = self.triangles <= _SCREEN_TRIANGLES
        large = self._halves.max(axis=1, initial=0.0) >= _SCREEN_HALF_SIZE
        solid = np.array([group.labelled and not group.cutoff for group in colored], dtype=bool)
        self.screens = simple & large & solid
        """Large and simple ones, such as walls: worth drawing first for what they hide."""
        surfaces = [surface for drawable in drawables for surface in drawable.model.surfaces]
        self._facets = facets_of({int(i): surfaces[i] for i in np.flatnonzero(simple & large)})

    def boxes(self, rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns middle (n, 3) and half edges (n, 3, 3) of each surface's box in the world.

        Args:
            rows: (m, 3, 4) poses of the geometries.
        """
        rows = rows[self.commands["instance"]]
        middles = np.einsum("nij,nj->ni", rows[:, :, :3], self._middles) + rows[:, :, 3]
        return middles, rows[:, :, :3] * self._halves[:, None, :]

    def magnified(
        self,
        seen: NDArray[np.int64],
        rows: NDArray[np.float64],
        X_CW: NDArray[np.float64],
        pinhole: Pinhole,
    ) -> NDArray[np.bool_]:
        """Returns which surfaces are known to be larger in view than their pictures, (n,).

        Args:
            seen: (k,) surfaces in question.
            rows: (m, 3, 4) poses of the geometries.
            X_CW: (4, 4) of the camera.
            pinhole: its model.
        """
        return magnified(self._facets, seen, rows[self.commands["instance"]], X_CW, pinhole)

    def in_order(
        self,
        seen: NDArray[np.int64],
        depth: NDArray[np.float64],
        magnified: NDArray[np.bool_] | None,
    ) -> tuple[NDArray[np.int64], list[Call]]:
        """Returns surfaces near to far, those of one picture together, and the calls for them.

        Near ones hide what is drawn later, before it costs anything.

        Args:
            seen: (k,) the surfaces.
            depth: (k,) of their middles, metres.
            magnified: (k,) of ``magnified``; without it depth alone is drawn, no pictures and
                labels.
        """
        colored = magnified is not None
        groups, group_of = self._groups[colored]
        if len(groups) == 1 and not colored:
            return seen[np.argsort(depth, kind="stable")], [Call(groups[0], False, 0, len(seen))]
        group = 2 * group_of[seen]
        if magnified is not None:
            group += magnified
        nearest = np.full(2 * len(groups), np.inf)
        np.minimum.at(nearest, group, depth)
        nearest += self._last[colored].repeat(2)
        order = np.lexsort((depth, group, nearest[group]))
        group = group[order]
        start = np.flatnonzero(np.diff(group, prepend=-1))
        end = np.append(start, len(seen))[1:]
        calls = [
            Call(groups[number >> 1], bool(number & 1), first, last - first)
            for number, first, last in zip(
                group[start].tolist(), start.tolist(), end.tolist(), strict=True
            )
        ]
        return seen[order], calls


def _numbered(groups: list[Group]) -> tuple[list[Any], NDArray[np.int64]]:
    """Returns the distinct groups, and each surface's number among them."""
    number = {group: index for index, group in enumerate(dict.fromkeys(groups))}
    return list(number), np.array([number[group] for group in groups], dtype=np.int64)
