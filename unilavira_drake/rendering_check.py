"""Preflight: one tiny render in a subprocess, and the remedy when it fails.

A missing driver makes VTK crash with a segmentation fault, and a missing library makes the import
of Drake fail; neither can be caught in the process that needs the picture.  Run as
``python -m unilavira_drake.rendering_check [vtk|raster]``.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from unilavira_drake.errors import RenderingError

PACKAGES = ("libglib2.0-0", "libegl1", "libgl1-mesa-dri")
"""What both renderers need from a Debian or Ubuntu system without a screen."""

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


def check_rendering(
    command: Sequence[str] | None = None, *, renderer: str = "vtk", timeout: float = 120.0
) -> None:
    """Renders one tiny picture in a subprocess; takes about a second.

    Args:
        command: what to run; this module by default.
        renderer: ``vtk`` or ``raster``; where the latter cannot draw, the former has to.
        timeout: wall-clock seconds.

    Raises:
        RenderingError: with the cause and the exact command that repairs it.
    """
    arguments = list(command or (sys.executable, "-m", "unilavira_drake.rendering_check", renderer))
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


def _render(renderer: str) -> None:
    """Renders a red box and checks the middle pixel."""
    if renderer == "raster":
        try:
            _check_red(_raster_pixels())
            return
        except RenderingError as error:
            print(f"{error}; VTK has to draw", file=sys.stderr)
    _check_red(_vtk_pixels())


def _check_red(pixels: Any) -> None:
    red, green, blue, _ = (int(value) for value in pixels[6, 8])
    if not red > 100 > max(green, blue):
        raise SystemExit(f"the test picture is wrong: its middle is {(red, green, blue)}, not red")
    print(_SUCCESS)


def _raster_pixels() -> Any:
    from pydrake.geometry import (
        Box,
        ClippingRange,
        DepthRange,
        GeometryInstance,
        PerceptionProperties,
        RenderCameraCore,
        Rgba,
        SceneGraph,
    )
    from pydrake.math import RigidTransform
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.sensors import CameraInfo

    from unilavira_drake.raster import RasterCamera, RasterCameraConfig, RasterView
    from unilavira_drake.raster.stage import shared_stage

    builder = DiagramBuilder()
    scene_graph: Any = builder.AddSystem(SceneGraph())
    p_CB: Any = [0.0, 0.0, 2.0]
    box = GeometryInstance(RigidTransform(p_CB), Box(1.0, 1.0, 1.0), "box")
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(1.0, 0.0, 0.0, 1.0))
    box.set_perception_properties(properties)
    scene_graph.RegisterAnchoredGeometry(scene_graph.RegisterSource("check"), box)
    core = RenderCameraCore(
        "raster",
        CameraInfo(16, 12, 10.0, 10.0, 8.0, 6.0),
        ClippingRange(0.1, 9.0),
        RigidTransform(),
    )
    view = RasterView(scene_graph.world_frame_id(), RigidTransform(), core, DepthRange(0.1, 9.0))
    camera: Any = builder.AddSystem(RasterCamera(shared_stage(), RasterCameraConfig((view,))))
    builder.Connect(scene_graph.get_query_output_port(), camera.query_object_input_port())
    diagram = builder.Build()
    context = camera.GetMyContextFromRoot(diagram.CreateDefaultContext())
    return camera.frames(context)[0].color


def _vtk_pixels() -> Any:
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
    return image.data.copy()


if __name__ == "__main__":
    _render(sys.argv[1] if len(sys.argv) > 1 else "vtk")
