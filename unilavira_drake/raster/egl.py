"""An OpenGL context without a window, on a display of its own.

A process has one EGL display for each device, and Drake's VTK renderer closes the display that it
draws on together with its last renderer, with all contexts on it.  So ours is opened on another
platform where there is one.
"""

from __future__ import annotations

import ctypes
from typing import Any

_LIBRARY = "libEGL.so.1"

_SURFACELESS_MESA, _DEVICE = 0x31DD, 0x313F
_OPENGL_API, _OPENGL_BIT = 0x30A2, 0x0008
_RENDERABLE_TYPE, _SURFACE_TYPE, _NONE = 0x3040, 0x3033, 0x3038
_MAJOR, _MINOR, _PROFILE, _CORE = 0x3098, 0x30FB, 0x30FD, 0x0001
_DRAW, _READ = 0x3059, 0x305A

_HANDLES = (
    ("eglGetCurrentDisplay", ()),
    ("eglGetCurrentContext", ()),
    ("eglGetCurrentSurface", (ctypes.c_int,)),
    ("eglGetPlatformDisplay", (ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)),
    ("eglGetProcAddress", (ctypes.c_char_p,)),
    ("eglCreateContext", (ctypes.c_void_p,) * 4),
)
_FLAGS = (
    ("eglInitialize", (ctypes.c_void_p,) * 3),
    ("eglBindAPI", (ctypes.c_uint,)),
    ("eglChooseConfig", (*(ctypes.c_void_p,) * 3, ctypes.c_int, ctypes.c_void_p)),
    ("eglMakeCurrent", (ctypes.c_void_p,) * 4),
    ("eglDestroyContext", (ctypes.c_void_p,) * 2),
)


class EglContext:
    """A context in the form that ``moderngl.create_context`` takes; use it by ``with``.

    Args:
        version: of OpenGL, as 430 for 4.3.

    Raises:
        OSError: if EGL or a driver of this version is missing.
    """

    def __init__(self, version: int) -> None:
        self._egl = _library()
        self._before: list[tuple[Any, ...]] = []
        problem = "no EGL display"
        for platform, device in ((_SURFACELESS_MESA, None), *_devices(self._egl)):
            self._display = self._egl.eglGetPlatformDisplay(platform, device, None)
            if not self._display or not self._egl.eglInitialize(self._display, None, None):
                continue
            self._context = self._create(version)
            if self._context:
                with self:
                    return
            problem = f"no OpenGL {version // 100}.{version // 10 % 10} on this display"
        raise OSError(problem)

    def _create(self, version: int) -> Any:
        egl = self._egl
        self._bind()
        wanted = _list(_SURFACE_TYPE, 0, _RENDERABLE_TYPE, _OPENGL_BIT, _NONE)
        config, count = ctypes.c_void_p(), ctypes.c_int()
        egl.eglChooseConfig(self._display, wanted, ctypes.byref(config), 1, ctypes.byref(count))
        if not count.value:
            return None
        attributes = _list(
            _MAJOR, version // 100, _MINOR, version // 10 % 10, _PROFILE, _CORE, _NONE
        )
        return egl.eglCreateContext(self._display, config, None, attributes)

    def _bind(self) -> None:
        self._egl.eglBindAPI(_OPENGL_API)

    def __enter__(self) -> EglContext:
        egl = self._egl
        before = (
            egl.eglGetCurrentDisplay(),
            egl.eglGetCurrentSurface(_DRAW),
            egl.eglGetCurrentSurface(_READ),
            egl.eglGetCurrentContext(),
        )
        self._bind()
        if not egl.eglMakeCurrent(self._display, None, None, self._context):
            raise OSError("the OpenGL context was closed by another user of its display")
        self._before.append(before)
        return self

    def __exit__(self, *_: object) -> None:
        before = self._before.pop()
        if not (before[3] and self._egl.eglMakeCurrent(*before)):
            self._egl.eglMakeCurrent(self._display, None, None, None)

    def load_opengl_function(self, name: str) -> int:
        """Returns the address of an OpenGL function, 0 when there is none."""
        return self._egl.eglGetProcAddress(name.encode()) or 0

    def release(self) -> None:
        """Destroys the context."""
        self._egl.eglDestroyContext(self._display, self._context)


def _library() -> Any:
    egl = ctypes.CDLL(_LIBRARY)
    for names, result in ((_HANDLES, ctypes.c_void_p), (_FLAGS, ctypes.c_uint)):
        for name, arguments in names:
            function = getattr(egl, name)
            function.argtypes, function.restype = arguments, result
    return egl


def _devices(egl: Any) -> list[tuple[int, Any]]:
    """Returns each graphics device as a platform and its handle."""
    address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    if not address:
        return []
    query = ctypes.CFUNCTYPE(
        ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int)
    )(address)
    devices, count = (ctypes.c_void_p * 16)(), ctypes.c_int()
    query(16, devices, ctypes.byref(count))
    return [(_DEVICE, device) for device in devices[: count.value]]


def _list(*values: int) -> Any:
    return (ctypes.c_int * len(values))(*values)
