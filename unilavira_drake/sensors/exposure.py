"""Exposure of the cameras: a gain for each picture, or one that is locked."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem
from pydrake.systems.sensors import ImageRgba8U

from unilavira_drake.ports import image_input, pixels
from unilavira_drake.sensors.exposure_config import ExposureConfig

LEAST_GAIN, MOST_GAIN = 0.1, 10.0
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_SRGB = np.arange(256) / 255.0
_LINEAR = np.where(_SRGB <= 0.04045, _SRGB / 12.92, ((_SRGB + 0.055) / 1.055) ** 2.4)


def gain_for(rgba: NDArray[np.uint8], target: float) -> float:
    """Returns the gain that brings the mean luminance of a picture to a target.

    Args:
        rgba: (H, W, 4) uint8, sRGB.
        target: share of white in linear light.
    """
    every = rgba[::4, ::4, :3]
    mean = float((_LINEAR[every] @ _LUMINANCE).mean())
    return float(np.clip(target / max(mean, 1e-6), LEAST_GAIN, MOST_GAIN))


def exposed(rgba: NDArray[np.uint8], gain: float) -> NDArray[np.uint8]:
    """Returns a picture under a gain in linear light; what is too bright is white."""
    linear = np.clip(_LINEAR * gain, 0.0, 1.0)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    table = np.round(255.0 * srgb).astype(np.uint8)
    out = np.array(rgba)
    out[..., :3] = table[rgba[..., :3]]
    return out


class ExposureControl(LeafSystem):
    """Sets the gain of the colour images of all views.

    Locked, it looks at the first front picture when the simulation begins, and again each time
    ``recalibrations``, a count, grows; the gain is in the Context, and one that was locked is kept
    by whoever initializes a clone of it.

    .. pydrake_system::

        name: ExposureControl
        input_ports:
        - (view).raw_image
        - recalibrations (optional)
        output_ports:
        - (view).color_image

    Args:
        config: ``auto`` or ``locked``.
        views: names of the views, ``front`` among them.
        period: seconds between two looks at ``recalibrations``.
    """

    def __init__(self, *, config: ExposureConfig, views: Sequence[str], period: float) -> None:
        super().__init__()
        self.set_name("exposure_control")
        self._locked = config.mode == "locked"
        self._target = config.target
        self._raw = {view: image_input(self, f"{view}.raw_image", ImageRgba8U) for view in views}
        for view in views:
            self.DeclareAbstractOutputPort(
                f"{view}.color_image", Value[ImageRgba8U], functools.partial(self._expose, view)
            )
        if self._locked:
            # Gain, 0 while it is not locked, and recalibrations seen.
            self._recalibrations = self.DeclareVectorInputPort("recalibrations", 1)
            unlocked: Any = np.array([0.0, 0.0])
            self._index = int(self.DeclareDiscreteState(unlocked))
            self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.5 * period, self._update)

    def _count(self, context: Context) -> float:
        if not self._recalibrations.HasValue(context):
            return 0.0
        count: Any = self._recalibrations.Eval(context)
        return float(count[0])

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        state: Any = context.get_discrete_state(self._index).value()
        if state[0] == 0.0:
            self._lock(context, discrete_state)

    def _lock(self, context: Context, discrete_state: DiscreteValues) -> None:
        gain = gain_for(pixels(self._raw["front"](context)), self._target)
        new = np.array([gain, self._count(context)])
        discrete_state.set_value(self._index, new)  # type: ignore[arg-type]

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        seen: Any = context.get_discrete_state(self._index).value()
        if self._count(context) > seen[1]:
            self._lock(context, discrete_state)

    def _expose(self, view: str, context: Context, output: Any) -> None:
        rgba = pixels(self._raw[view](context))
        if self._locked:
            state: Any = context.get_discrete_state(self._index).value()
            gain = float(state[0]) or 1.0
        else:
            gain = gain_for(rgba, self._target)
        image = ImageRgba8U(rgba.shape[1], rgba.shape[0])
        data: Any = image.mutable_data
        data[:] = exposed(rgba, gain)
        output.set_value(image)
