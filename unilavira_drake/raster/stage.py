"""The one OpenGL context of a process, with its programs, pictures and image targets."""

from __future__ import annotations

import atexit
import ctypes
import os
import threading
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.errors import RenderingError
from unilavira_drake.raster import shaders
from unilavira_drake.raster.egl import EglContext
from unilavira_drake.raster.recent import Recent
from unilavira_drake.raster.surface import Texture

REQUIRED_VERSION = 430
"""OpenGL 4.3: many objects in one draw call."""

INFINITY = float("inf")

EMPTY = 32766
"""Drake's label of pixels that show nothing."""

_SCENES, _TARGETS = 8, 4

_TEXTURE_2D, _RGBA, _RGBA8, _UNSIGNED_BYTE = 0x0DE1, 0x1908, 0x8058, 0x1401
_TEX_IMAGE_2D = ctypes.CFUNCTYPE(
    None,
    *(ctypes.c_uint, *(ctypes.c_int,) * 5, ctypes.c_uint, ctypes.c_uint, ctypes.c_void_p),
)
"""OpenGL's upload of one size of a picture, which moderngl lacks."""


@dataclass(frozen=True, eq=False)
class Target:
    """Images to draw into.

    Labels are two bytes of a picture, not integers: those cannot be cleared by a plain call.
    """

    images: Any
    """Framebuffer with colour, depth and label."""
    depth: Any
    """Framebuffer with the same depth alone."""

    def clear(self, background: tuple[float, float, float], *, colored: bool) -> None:
        """Fills the images with what a pixel without geometry shows."""
        if not colored:
            self.depth.clear(INFINITY)
            return
        empty = (EMPTY & 255) / 255.0, (EMPTY >> 8) / 255.0
        for index, value in enumerate(((*background, 1.0), (INFINITY,), empty)):
            self.images.color_mask = tuple((index == other,) * 4 for other in range(3))
            self.images.clear(*value)
        self.mask_labels(False)

    def mask_labels(self, masked: bool) -> None:
        """Leaves labels as they are, or draws them like the others."""
        self.images.color_mask = ((True,) * 4, (True,) * 4, (not masked,) * 4)


class Stage:
    """Owns the OpenGL context; everything that is drawn in a process is drawn here.

    Use ``with stage.current():`` around each use, so that other renderers of the process, such as
    Drake's VTK, keep a context of their own.
    """

    def __init__(self) -> None:
        canvas = _open_egl()
        self._context = _open_context(canvas)
        self._tex_image = _TEX_IMAGE_2D(canvas.load_opengl_function("glTexImage2D"))
        self._lock = threading.RLock()
        # Objects without an owner are collected at the next use, when the context is current.
        self._context.gc_mode = "context_gc"
        self._textures: weakref.WeakValueDictionary[str, Any] = weakref.WeakValueDictionary()
        self._targets = Recent(_TARGETS)
        self.batches: weakref.WeakValueDictionary[tuple[str, ...], Any] = (
            weakref.WeakValueDictionary()
        )
        self.scenes = Recent(_SCENES)
        """Of ``Scene``, by their geometries.  They belong to no camera: Drake's bindings for Python
        3.10 and 3.11 never free a Diagram with a System written in Python."""
        with self.current():
            self.programs: dict[tuple[str, ...], Any] = {
                defines: self._program(shaders.VERTEX_SHADER, shaders.FRAGMENT_SHADER, defines)
                for defines in (
                    ("COLORED",),
                    ("COLORED", "TEXTURED"),
                    ("COLORED", "TEXTURED", "MASKED"),
                    (),
                    ("TEXTURED", "MASKED"),
                )
            }
            self.exposure = self._context.buffer(reserve=shaders.EXPOSURE.itemsize, dynamic=True)
            self.exposure.bind_to_uniform_block(0)

    @contextmanager
    def current(self) -> Iterator[Any]:
        """Makes the context current in this thread, and gives back the one before."""
        with self._lock, self._context:
            self._context.gc()
            yield self._context

    def texture(self, texture: Texture) -> Any:
        """Returns a picture with its mipmaps, shared by all that show it."""
        found = self._textures.get(texture.key)
        if found is None:
            height, width, _ = texture.pixels.shape
            found = self._context.texture((width, height), 4, texture.pixels)
            found.use(0)
            self._upload_levels(texture.pixels)
            found.repeat_x = found.repeat_y = texture.repeats
            self._textures[texture.key] = found
        return found

    def _upload_levels(self, pixels: NDArray[np.uint8]) -> None:
        """Uploads the smaller sizes of the bound picture.

        Made here: the software renderer takes as long for each as for a small frame.
        """
        height, width, _ = pixels.shape
        level = 0
        while max(width, height) > 1:
            width, height, level = max(1, width // 2), max(1, height // 2), level + 1
            resized: Any = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
            pixels = np.ascontiguousarray(resized)
            size = (width, height, 0, _RGBA, _UNSIGNED_BYTE)
            self._tex_image(_TEXTURE_2D, level, _RGBA8, *size, pixels.ctypes.data)

    def target(self, width: int, height: int) -> Target:
        """Returns images of a size, shared by all that draw in it."""
        found: Target = self._targets.get((width, height), lambda: self._target((width, height)))
        return found

    def _target(self, size: tuple[int, int]) -> Target:
        depth = self._context.texture(size, 1, dtype="f4")
        near = self._context.depth_renderbuffer(size)
        color = self._context.texture(size, 4)
        label = self._context.texture(size, 2)
        return Target(
            self._context.framebuffer([color, depth, label], near),
            self._context.framebuffer([depth], near),
        )

    def sizes(self) -> tuple[int, int, int]:
        """Returns how many scenes, batches of triangles and pictures are kept."""
        return len(self.scenes), len(self.batches), len(self._textures)

    def _program(self, vertex: str, fragment: str, defines: tuple[str, ...]) -> Any:
        return self._context.program(
            vertex_shader=shaders.source(vertex, *defines),
            fragment_shader=shaders.source(fragment, *defines),
        )

    def release(self) -> None:
        """Frees the context; nothing can be drawn any more."""
        with self._lock:
            self._context.release()


_stage: Stage | None = None
_process = 0
_opening = threading.Lock()


def shared_stage() -> Stage:
    """Returns the stage of this process, opened by the first caller.

    Raises:
        RenderingError: if ``moderngl`` or OpenGL is missing or too old, or in a process that was
            forked from one with a stage.
    """
    global _stage, _process
    with _opening:
        if _stage is None:
            _stage, _process = Stage(), os.getpid()
            atexit.register(_stage.release)
        elif _process != os.getpid():
            raise RenderingError(
                "rendering: an OpenGL context does not survive a fork; start processes with the "
                "method 'spawn'"
            )
        return _stage


def _open_egl() -> EglContext:
    try:
        return EglContext(REQUIRED_VERSION)
    except OSError as error:
        raise RenderingError(
            f"rendering: {error} (Debian and Ubuntu need libegl1 and libgl1-mesa-dri)"
        ) from None


def _open_context(canvas: EglContext) -> Any:
    try:
        import moderngl
    except ImportError as error:
        raise RenderingError(
            f"rendering: moderngl cannot be imported ({error}); run: pip install moderngl"
        ) from None
    create: Any = moderngl.create_context
    try:
        with canvas:
            return create(standalone=True, context=canvas, require=REQUIRED_VERSION)
    except Exception as error:
        raise RenderingError(f"rendering: moderngl cannot be used: {error}") from None
