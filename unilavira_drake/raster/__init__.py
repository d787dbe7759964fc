"""A camera for SceneGraph that draws colour, metric depth and label in one OpenGL pass.

It takes the place of Drake's ``RgbdSensor`` and its VTK renderer at a fraction of their CPU time;
see ``add_raster_camera``.
"""

from unilavira_drake.raster.adding import RasterFallbackWarning, add_raster_camera, raster_works
from unilavira_drake.raster.config import RasterCameraConfig, RasterView
from unilavira_drake.raster.frames import Frame
from unilavira_drake.raster.geometry import AcceptingRendererWarning
from unilavira_drake.raster.light import Light, suns_of
from unilavira_drake.raster.system import RasterCamera

__all__ = [
    "AcceptingRendererWarning",
    "Frame",
    "Light",
    "RasterCamera",
    "RasterCameraConfig",
    "RasterFallbackWarning",
    "RasterView",
    "add_raster_camera",
    "raster_works",
    "suns_of",
]
