"""The camera as a System."""

from __future__ import annotations

import functools
import weakref
from typing import Any

from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, InputPort, LeafSystem, ValueProducer
from pydrake.systems.sensors import ImageDepth16U, ImageDepth32F, ImageLabel16I, ImageRgba8U

from unilavira_drake.raster.config import RasterCameraConfig, RasterView
from unilavira_drake.raster.frames import Frame, millimetres
from unilavira_drake.raster.renderer import RasterRenderer
from unilavira_drake.raster.stage import Stage


class RasterCamera(LeafSystem):
    """Takes pictures of a SceneGraph: colour, metric depth and label in one pass.

    .. pydrake_system::

        name: RasterCamera
        input_ports:
        - geometry_query
        output_ports:
        - color_image
        - depth_image_32f
        - depth_image_16u
        - label_image
        - body_pose_in_world
        - image_time

    The ports are those of Drake's ``RgbdSensor``; in a rig of several views each view has its own,
    ``NAME.color_image`` and so on, but for the one ``image_time``.  All views are drawn in one
    call and kept in the Context as one frozen value, so a clone shares them; an image port holds
    pixels once it is pulled.  A pull of depth alone draws depth alone.

    Pictures depend on geometries and poses alone, not on the Context.  A geometry that is added or
    removed is noticed by its id.  A shape that changes under the same id is noticed where the
    geometry has the proximity or the illustration role, too.  A changed perception property is
    not, unless the scene graph has a render engine: without one SceneGraph keeps no version of
    that role, and to read all properties for each picture would cost as much as a small picture.
    Register the geometry anew instead.

    Args:
        stage: where to draw.
        config: views, light and background.
    """

    def __init__(self, stage: Stage, config: RasterCameraConfig) -> None:
        super().__init__()
        # Drake's C++ side holds the callbacks, some out of sight of Python's collector: with a
        # strong reference this System would never be freed.
        own: Any = weakref.proxy(self)
        self._renderer = RasterRenderer(stage, config)
        query = self.DeclareAbstractInputPort("geometry_query", Value[QueryObject]())
        ticket = {self.input_port_ticket(query.get_index())}
        self._frames = {
            colored: self.DeclareCacheEntry(
                "colour, depth and label" if colored else "depth",
                ValueProducer(
                    allocate=lambda: AbstractValue.Make(()),
                    calc=functools.partial(RasterCamera._expose, own, colored),
                ),
                ticket,
            ).cache_index()
            for colored in (True, False)
        }
        for index, view in enumerate(config.views):
            self._declare_view(own, index, view, ticket)
        calc_time = functools.partial(RasterCamera._calc_time, own)
        self.DeclareVectorOutputPort("image_time", 1, calc_time, {self.time_ticket()})

    @property
    def renderer(self) -> RasterRenderer:
        """What draws; shared by all Contexts."""
        return self._renderer

    def query_object_input_port(self) -> InputPort:
        """Returns the port to connect to the scene graph's query port."""
        return self.GetInputPort("geometry_query")

    def _declare_view(self, own: Any, index: int, view: RasterView, ticket: Any) -> None:
        for name, image_type, colored, pixels in (
            ("color_image", ImageRgba8U, True, lambda frame: frame.color),
            ("depth_image_32f", ImageDepth32F, False, lambda frame: frame.depth[..., None]),
            (
                "depth_image_16u",
                ImageDepth16U,
                False,
                lambda frame: millimetres(frame.depth)[..., None],
            ),
            ("label_image", ImageLabel16I, True, lambda frame: frame.label[..., None]),
        ):
            calc = functools.partial(RasterCamera._fill, own, index, colored, pixels)
            self.DeclareAbstractOutputPort(view.port(name), Value[image_type], calc, ticket)
        self.DeclareAbstractOutputPort(
            view.port("body_pose_in_world"),
            Value[RigidTransform],
            functools.partial(RasterCamera._calc_pose, own, view),
            ticket,
        )

    def frames(self, context: Context, *, colored: bool = True) -> tuple[Frame, ...]:
        """Returns one frozen frame per view, drawn at most once for a Context's poses.

        Args:
            context: of this System.
            colored: whether colour and label are wanted beside depth.
        """
        if not colored and not self.get_cache_entry(self._frames[True]).is_out_of_date(context):
            colored = True
        frames: Any = self.get_cache_entry(self._frames[colored]).Eval(context)
        return tuple(frames)

    def _expose(self, colored: bool, context: Context, value: Any) -> None:
        value.set_value(self._renderer.draw(self._query_object(context), colored=colored))

    def _fill(self, index: int, colored: bool, pixels: Any, context: Context, output: Any) -> None:
        data = pixels(self.frames(context, colored=colored)[index])
        image = output.get_mutable_value()
        if (image.height(), image.width()) != data.shape[:2]:
            image.resize(data.shape[1], data.shape[0])
        image.mutable_data[:] = data

    def _calc_pose(self, view: RasterView, context: Context, output: Any) -> None:
        X_WP = self._query_object(context).GetPoseInWorld(view.parent_frame_id)
        output.set_value(X_WP.multiply(view.X_PB))

    def _calc_time(self, context: Context, output: Any) -> None:
        output.SetAtIndex(0, context.get_time())

    def _query_object(self, context: Context) -> QueryObject:
        query: Any = self.get_input_port().Eval(context)
        assert isinstance(query, QueryObject)
        return query
