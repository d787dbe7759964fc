"""Pictures of a first run, shown again in those that follow: simulation without rendering."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any
from unittest import mock

from unilavira_drake.raster.renderer import RasterRenderer


class KeptPictures:
    """What the camera drew in one run, for further runs of the same simulation.

    To leave the renderer's own time out of a figure is not enough to exclude it: a software
    renderer goes through megabytes for each picture, and what runs next finds the caches cold.
    """

    def __init__(self) -> None:
        self._drawn: list[tuple[bool, Any]] = []

    @contextlib.contextmanager
    def drawn(self) -> Iterator[None]:
        """Keeps what is drawn inside."""
        draw = RasterRenderer.draw

        def keep(renderer: RasterRenderer, query: Any, *, colored: bool) -> Any:
            frames = draw(renderer, query, colored=colored)
            self._drawn.append((colored, frames))
            return frames

        with mock.patch.object(RasterRenderer, "draw", keep):
            yield

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Shows inside, one after the other, what was kept.

        Raises:
            RuntimeError: if other pictures are asked for than were drawn.
        """
        left = iter(self._drawn)

        def show(_renderer: RasterRenderer, _query: Any, *, colored: bool) -> Any:
            kept_colored, frames = next(left, (None, None))
            if kept_colored != colored:
                raise RuntimeError("the runs are not of one simulation: other pictures")
            return frames

        with mock.patch.object(RasterRenderer, "draw", show):
            yield
        if next(left, None) is not None:
            raise RuntimeError("the runs are not of one simulation: pictures are left")
