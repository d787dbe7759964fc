"""Scenes that cameras are compared on: a plain textured room, and one of every shape."""

from __future__ import annotations

import math
from typing import Any

from pydrake.geometry import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    GeometryInstance,
    PerceptionProperties,
    RenderLabel,
    Rgba,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw

ROOM = """
name: room
wall_height: 2.6
wall_thickness: 0.1
rooms:
- {name: hall, kind: hall, rectangle: [0, 0, 5, 4], floor: oak, walls: cream_paint}
- {name: kitchen, kind: kitchen, rectangle: [5, 0, 9, 4], floor: white_tile, walls: white_tiles}
doors:
- {name: door, rooms: [hall, kitchen], position: [5.0, 2.0], width: 1.0, color: white}
objects:
- {name: sofa_1, category: sofa, color: red, room: hall, position: [1.6, 0.6], yaw_degrees: 90}
"""


def add_shapes(plant: Any, graph: Any) -> None:
    """Adds a ring of primitive shapes."""
    shapes = (
        Box(0.5, 0.7, 0.9),
        Sphere(0.4),
        Cylinder(0.3, 0.8),
        Capsule(0.25, 0.6),
        Ellipsoid(0.2, 0.3, 0.5),
    )
    for index in range(20):
        angle = 0.1 * math.pi * index
        X = RigidTransform(
            RollPitchYaw(0.3, 0.5, index), [3.0 * math.cos(angle), 3.0 * math.sin(angle), 1.0]
        )
        one = GeometryInstance(X, shapes[index % 5], f"shape_{index}")
        properties = PerceptionProperties()
        properties.AddProperty("label", "id", RenderLabel(index + 1))
        properties.AddProperty("phong", "diffuse", Rgba(0.3, 0.6, 0.9, 1.0))
        one.set_perception_properties(properties)
        graph.RegisterAnchoredGeometry(plant.get_source_id(), one)
