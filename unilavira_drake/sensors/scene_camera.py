"""A camera with a scene of its own, so that a cloned Context sees the very same pictures."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, Diagram, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageLabel16I, ImageRgba8U

from unilavira_drake.ports import vector_input


class SceneCamera(LeafSystem):
    """Renders the state of a plant in a private copy of it: pictures as a function of positions.

    Drake's renderer is part of a Context.  Each clone gets its own (50 MB), which draws the
    geometry in another order and so decides a few pixels on shared edges differently; then a
    cloned episode would ask its model something else.  Here one renderer serves all Contexts.
    It is no state: what it draws depends on the positions alone.

    .. pydrake_system::

        name: SceneCamera
        input_ports:
        - plant_state
        output_ports:
        - (view).color_image
        - (view).depth_image
        - (view).label_image

    Args:
        scene: a Diagram with a subsystem ``plant`` of the same positions as the simulated one,
            and the output ports of this System.
        views: names of the views.
    """

    def __init__(self, scene: Diagram, *, views: Sequence[str]) -> None:
        super().__init__()
        self._scene = scene
        plant = scene.GetSubsystemByName("plant")
        assert isinstance(plant, MultibodyPlant)
        self._plant = plant
        # The renderer's own memory; every picture sets all positions before it is drawn.
        self._scene_context = scene.CreateDefaultContext()
        self._state = vector_input(
            self, "plant_state", self._plant.num_positions() + self._plant.num_velocities()
        )
        ticket = self.input_port_ticket(self.GetInputPort("plant_state").get_index())
        for view in views:
            for image, image_type in (
                ("color_image", ImageRgba8U),
                ("depth_image", ImageDepth32F),
                ("label_image", ImageLabel16I),
            ):
                name = f"{view}.{image}"
                self.DeclareAbstractOutputPort(
                    name,
                    Value[image_type],
                    functools.partial(self._render, name),
                    prerequisites_of_calc={ticket},
                )

    def _render(self, name: str, context: Context, output: Any) -> None:
        positions: Any = self._state(context)[: self._plant.num_positions()]
        plant_context = self._plant.GetMyMutableContextFromRoot(self._scene_context)
        if not np.array_equal(positions, self._plant.GetPositions(plant_context)):
            self._plant.SetPositions(plant_context, positions)
        output.set_value(self._scene.GetOutputPort(name).Eval(self._scene_context))
