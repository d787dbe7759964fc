"""Preflight: one tiny render in a subprocess, and the remedy when it fails.

A missing driver makes VTK crash with a segmentation fault, and a missing library makes the import
of Drake fail; neither can be caught in the process that needs the picture.  Run as
``python -m unilavira_drake.rendering_check``.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from unilavira_drake.errors import RenderingError

PACKAGES = ("libglib2.0-0", "libegl1", "libgl1-mesa-dri")
"""What Drake's renderer needs from a Debian or Ubuntu system without a screen."""

REMEDY = f"sudo apt-get install -y --no-install-recommends {' '.join(PACKAGES)}"

_SUCCESS = "rendering works"

# A part of the output, in lower case, and what it means; the first that is found counts.
_CAUSES = (
    ("libglib-2.0.so.0", "Drake cannot be imported: the system lacks libglib2.0-0"),
    ("libegl.so", "no EGL: the system lacks libegl1"),
    ("failed to initialize opengl functions", "no OpenGL driver: the system lacks libgl1-mesa-dri"),
    ("could not initialize egl", "EGL found no usable device: the system lacks libgl1-mesa-dri"),
    ("egl", "EGL does not work"),
)
_CRASHES = (-signal.SIGSEGV, 128 + signal.SIGSEGV, -signal.SIGABRT, 128 + signal.SIGABRT)


def check_rendering(command: Sequence[str] | None = None, *, timeout: float = 120.0) -> None:
    """Renders one tiny picture in a subprocess; takes about a second.

    Args:
        command: what to run; this module by default.
        timeout: wall-clock seconds.

    Raises:
        RenderingError: with the cause and the exact command that repairs it.
    """
    arguments = list(command or (sys.executable, "-m", "unilavira_drake.rendering_check"))
    try:
        done = subprocess.run(
            arguments, capture_output=True, text=True, errors="replace", timeout=timeout
        )
    except subprocess.TimeoutExpired:
        raise RenderingError(
            f"rendering: a test picture was not ready after {timeout:.0f} s; "
            f"check the graphics driver, or reinstall what rendering needs: {REMEDY}"
        ) from None
    problem = diagnose(done.returncode, done.stdout, done.stderr)
    if problem:
        raise RenderingError(problem)


def diagnose(returncode: int, stdout: str, stderr: str) -> str:
    """Returns what is wrong and how to repair it; empty when the picture was made."""
    if returncode == 0 and _SUCCESS in stdout:
        return ""
    output = f"{stdout}\n{stderr}".lower()
    cause = next((text for key, text in _CAUSES if key in output), "")
    if not cause and "no module named 'pydrake'" in output:
        return "rendering: Drake is not installed; run: pip install drake"
    if not cause and returncode in _CRASHES:
        cause = "the renderer crashed, as it does where libgl1-mesa-dri is missing"
    if not cause:
        last = (stderr.strip() or stdout.strip() or "no output").splitlines()[-1]
        cause = f"the test picture failed (exit code {returncode}): {last}"
    return f"rendering: {cause}. Install what it needs: {REMEDY}"


def _render() -> None:
    """Renders a red box and checks the middle pixel."""
    from pydrake.geometry import (
        Box,
        ClippingRange,
        ColorRenderCamera,
        GeometryId,
        MakeRenderEngineVtk,
        PerceptionProperties,
        RenderCameraCore,
        RenderEngineVtkParams,
        RenderLabel,
        Rgba,
    )
    from pydrake.math import RigidTransform
    from pydrake.systems.sensors import CameraInfo, ImageRgba8U

    engine = MakeRenderEngineVtk(RenderEngineVtkParams(backend="EGL"))
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(1.0, 0.0, 0.0, 1.0))
    properties.AddProperty("label", "id", RenderLabel(1))
    p_CB: Any = [0.0, 0.0, 2.0]
    box, pose = Box(1.0, 1.0, 1.0), RigidTransform(p_CB)
    engine.RegisterVisual(GeometryId.get_new_id(), box, properties, pose, needs_updates=False)
    core = RenderCameraCore(
        "vtk", CameraInfo(16, 12, 10.0, 10.0, 7.5, 5.5), ClippingRange(0.1, 10.0), RigidTransform()
    )
    image: Any = ImageRgba8U(16, 12)
    engine.RenderColorImage(ColorRenderCamera(core, False), image)
    red, green, blue, _ = (int(value) for value in image.data[6, 8])
    if not red > 100 > max(green, blue):
        raise SystemExit(f"the test picture is wrong: its middle is {(red, green, blue)}, not red")
    print(_SUCCESS)


if __name__ == "__main__":
    _render()
