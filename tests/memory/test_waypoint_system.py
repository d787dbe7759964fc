"""When the waypoint memory takes a picture on the way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context
from pydrake.systems.sensors import ImageRgba8U

from unilavira_drake.memory.waypoint_system import WaypointMemory
from unilavira_drake.memory.waypoints import WaypointState
from unilavira_drake.messages import Frame, LanguageAction, Panorama, VisionAction

SIZE = (48, 64, 3)


class Way:
    """A memory at its first waypoint, and a robot that is put somewhere."""

    def __init__(self, *, tool: str = "turn", look_changes: bool = True) -> None:
        self.memory = WaypointMemory(
            period=0.1,
            waypoints=32,
            decisions=8,
            keyframes=8,
            keyframe_travel=1.5,
            merge_distance=0.5,
            picture_width=32,
        )
        self.context: Context = self.memory.CreateDefaultContext()
        self.look_changes = look_changes
        self.random = np.random.default_rng(0)
        front = Frame(color=self.random.integers(0, 256, SIZE, np.uint8))
        self.fix("panorama", Panorama(n=1, first=1, frames=(front,)))
        self.fix("language_action", LanguageAction())
        self.fix("vision_action", VisionAction())
        self.fix("front.color_image", ImageRgba8U(64, 48))
        self.state: WaypointState = WaypointState()
        self.at(0.0, 0.0)
        action = LanguageAction(n=1, tool=tool, direction="left" if tool == "turn" else "")
        self.fix("language_action", action)

    def fix(self, port: str, value: object) -> None:
        model = Value[type(value)](value) if "pydrake" in str(type(value)) else None
        self.memory.GetInputPort(port).FixValue(self.context, model or AbstractValue.Make(value))

    def at(self, x: float, yaw: float) -> int:
        """Puts the robot there; returns how many pictures the memory then holds."""
        if self.look_changes:
            image = ImageRgba8U(64, 48)
            image.mutable_data[:] = self.random.integers(0, 256, (48, 64, 4))
            self.fix("front.color_image", image)
        self.fix("pose_estimate", RigidTransform(RotationMatrix.MakeZRotation(yaw), [x, 0.0, 0.0]))
        self.state = self.memory.step(self.context, self.state)
        return len(self.state.pictures)


def test_a_picture_after_each_keyframe_travel() -> None:
    way = Way()
    counts = [way.at(0.3 * i, 0.0) for i in range(1, 21)]
    assert counts[-1] == 1 + 4
    assert [i for i in range(1, 20) if counts[i] > counts[i - 1]] == [4, 9, 14, 19]
    first, *others = way.state.pictures
    assert (first.label, first.n) == ("H1: front view at waypoint 1", 1)
    assert {p.label.partition(": ")[2] for p in others} == {"leaving waypoint 1 by its left view"}


def test_a_picture_when_the_view_has_turned() -> None:
    way = Way()
    assert way.at(0.3, math.radians(40.0)) == 1
    assert way.at(0.6, math.radians(50.0)) == 2
    assert way.at(0.9, math.radians(90.0)) == 2
    assert way.at(1.2, math.radians(96.0)) == 3


def test_turning_in_place_takes_none() -> None:
    way = Way()
    assert [way.at(0.1, angle) for angle in np.linspace(0, 2 * math.pi, 9)] == [1] * 9


def test_none_that_looks_the_same_and_none_on_the_way_back() -> None:
    same, back = Way(look_changes=False), Way(tool="backtrack")
    assert same.at(2.0, 0.0) == 2
    assert same.at(4.0, 0.0) == 2
    assert back.at(2.0, 0.0) == 1


@pytest.mark.parametrize("step", [0.05, 0.1])
def test_travel_is_summed_along_the_way(step: float) -> None:
    way = Way()
    # Back and forth on half a metre.
    places = [0.25 - abs((step * i) % 0.5 - 0.25) for i in range(int(6.0 / step))]
    count = [way.at(2 * x, 0.0) for x in places][-1]
    assert 1 + 4 <= count <= 1 + 8
