"""The observer with fixed inputs: when it captures, and when it does not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import ImageDepth32F, ImageLabel16I, ImageRgba8U

from unilavira_drake.messages import VIEW_YAW, Intrinsics, NavigationStatus
from unilavira_drake.sensors.observer import Observer

INTRINSICS = Intrinsics(4, 3, 2.0, 2.0, 1.5, 1.0)


class Bench:
    """An observer whose inputs are set by hand."""

    def __init__(self, **options: Any) -> None:
        self.observer = Observer(intrinsics=INTRINSICS, period=0.1, **options)
        self.simulator = Simulator(self.observer)
        self.context = self.simulator.get_mutable_context()
        for view in options.get("views", ("front",)):
            for name, image in (
                ("color_image", ImageRgba8U(4, 3)),
                ("depth_image", ImageDepth32F(4, 3)),
                ("label_image", ImageLabel16I(4, 3)),
            ):
                self.fix(f"{view}.{name}", Value[type(image)](image))
            down = view == "down"
            turn = RollPitchYaw(math.pi if down else -math.pi / 2, 0, -math.pi / 2)
            yaw = RotationMatrix.MakeZRotation(VIEW_YAW.get(view, 0.0))
            camera = RigidTransform(yaw.multiply(turn.ToRotationMatrix()), [0.0, 0, 1.0])
            self.fix(f"{view}.X_BC", Value[RigidTransform](camera))
        self.status(0, "arrived")
        self.stand(0.0, 0.0, 0.3)

    def fix(self, name: str, value: Any) -> None:
        """Fixes an input port."""
        self.observer.GetInputPort(name).FixValue(self.context, value)

    def status(self, n: int, state: str, heading: float | None = None) -> None:
        """Sets the navigation status."""
        value = NavigationStatus(n, state, heading=heading)
        self.fix("navigation_status", AbstractValue.Make(value))

    def stand(self, x: float, y: float, yaw: float, rate: float = 0.0) -> None:
        """Sets pose and yaw rate."""
        pose = RigidTransform(RotationMatrix.MakeZRotation(yaw), [x, y, 0])
        self.fix("pose_estimate", Value[RigidTransform](pose))
        self.observer.GetInputPort("twist").FixValue(
            self.context, np.array([0, 0, rate, 0, 0, 0.0])
        )

    def run(self, seconds: float) -> None:
        """Advances the simulation."""
        self.simulator.AdvanceTo(self.context.get_time() + seconds)

    def output(self, name: str) -> Any:
        """Returns an output."""
        return self.observer.GetOutputPort(name).Eval(self.context)

    def sweep(self, x: float, y: float) -> None:
        """Follows the sweep like a perfect robot."""
        for _ in range(4):
            self.run(0.1)
            if self.output("sweep").active:
                self.stand(x, y, self.output("sweep").heading)
        self.run(0.1)


def test_sweep_captures_four_views_in_order_from_the_arrival_heading() -> None:
    bench = Bench()
    bench.run(0.05)
    assert bench.output("sweep").heading == pytest.approx(0.3)
    bench.sweep(0.0, 0.0)
    panorama = bench.output("panorama")
    assert (panorama.n, panorama.first) == (1, 1)
    assert [f.view for f in panorama.frames] == ["front", "left", "back", "right"]
    assert panorama.yaw == pytest.approx(0.3)
    axis = panorama.frame("left").X_WC[:3, 2]
    assert axis == pytest.approx([math.cos(0.3 + math.pi / 2), math.sin(0.3 + math.pi / 2), 0])
    assert panorama.frame("left").jpeg.startswith(b"\xff\xd8")
    assert not bench.output("sweep").active


def test_the_sweep_may_go_to_the_other_side() -> None:
    bench = Bench(sweep_direction="right")
    bench.sweep(0.0, 0.0)
    panorama = bench.output("panorama")
    assert [f.view for f in panorama.frames] == ["front", "right", "back", "left"]
    axis = panorama.frame("left").X_WC[:3, 2]
    assert axis == pytest.approx([math.cos(0.3 + math.pi / 2), math.sin(0.3 + math.pi / 2), 0])


def test_no_capture_while_turning() -> None:
    bench = Bench()
    bench.stand(0, 0, 0.3, rate=1.0)
    bench.run(1.0)
    assert bench.output("sweep").active
    assert bench.output("sweep").heading == pytest.approx(0.3)


def test_a_blocked_turn_ends_at_the_deadline_with_the_true_pose() -> None:
    bench = Bench()
    bench.run(40.0)  # the robot never turns: three views wait for the deadline
    panorama = bench.output("panorama")
    assert panorama.n == 1
    assert pytest.approx(panorama.frame("front").X_WC) == panorama.frame("back").X_WC


def test_waits_for_a_terminal_status_of_its_own_number() -> None:
    bench = Bench()
    bench.sweep(0.0, 0.0)
    bench.status(1, "moving")
    bench.run(1.0)
    assert bench.output("panorama").n == 1
    bench.status(2, "arrived")
    bench.run(1.0)
    assert bench.output("panorama").n == 1


def test_unmoved_robot_reissues_its_frames_with_the_outcome() -> None:
    bench = Bench()
    bench.sweep(0.0, 0.0)
    first = bench.output("panorama")
    bench.status(1, "failed")
    bench.run(0.2)
    again = bench.output("panorama")
    assert (again.n, again.first, again.outcome.state) == (2, 1, "failed")
    assert again.frames is first.frames


@pytest.mark.parametrize(
    ("state", "age", "anew"),
    [("failed", 1.0, False), ("failed", 3.0, True), ("arrived", 3.0, False)],
)
def test_after_a_failure_old_frames_are_taken_anew_where_people_walk(
    state: str, age: float, anew: bool
) -> None:
    bench = Bench(max_age=2.0)
    bench.sweep(0.0, 0.0)
    first = bench.output("panorama")
    bench.run(age)
    bench.status(1, state)
    bench.run(0.2)
    assert bench.output("sweep").active == anew
    bench.sweep(0.0, 0.0)
    again = bench.output("panorama")
    assert again.n == 2
    assert (again.frames is first.frames) == (not anew)
    # The four words keep their meaning.
    assert again.yaw == pytest.approx(first.yaw)


@pytest.mark.parametrize("heading", [None, 1.2])
def test_moved_robot_sweeps_from_the_given_or_the_arrival_heading(heading: float | None) -> None:
    bench = Bench()
    bench.sweep(0.0, 0.0)
    bench.stand(1.0, 0.0, -0.5)
    bench.status(1, "arrived", heading)
    bench.run(0.1)
    assert bench.output("sweep").active
    assert bench.output("sweep").heading == pytest.approx(-0.5 if heading is None else heading)


def test_a_backtrack_to_the_same_place_with_another_front_sweeps_again() -> None:
    bench = Bench()
    bench.sweep(0.0, 0.0)
    bench.status(1, "arrived", 0.3 + math.pi / 2)
    bench.run(0.1)
    assert bench.output("sweep").active


RING = ("front", "back", "right", "left")


def test_a_ring_sees_all_at_once_and_need_not_turn() -> None:
    bench = Bench(views=RING)
    bench.run(0.05)
    assert not bench.output("sweep").active
    bench.run(0.1)
    panorama = bench.output("panorama")
    assert [f.view for f in panorama.frames] == ["front", "left", "back", "right"]
    assert len({f.time for f in panorama.frames}) == 1
    assert panorama.yaw == pytest.approx(0.3)
    for view, turn in VIEW_YAW.items():
        axis = panorama.frame(view).X_WC[:3, 2]
        assert axis == pytest.approx([math.cos(0.3 + turn), math.sin(0.3 + turn), 0], abs=1e-9)


def test_a_ring_turns_to_a_demanded_heading_first() -> None:
    bench = Bench(views=RING)
    bench.run(0.2)
    bench.stand(1.0, 0.0, -0.5)
    bench.status(1, "arrived", 1.2)
    bench.run(0.2)
    assert bench.output("panorama").n == 1
    assert bench.output("sweep").active
    assert bench.output("sweep").heading == pytest.approx(1.2)
    bench.stand(1.0, 0.0, 1.21)
    bench.run(0.2)
    panorama = bench.output("panorama")
    assert (panorama.n, len(panorama.frames)) == (2, 4)
    assert panorama.yaw == pytest.approx(1.21)
    assert not bench.output("sweep").active


def test_a_ring_waits_for_rest() -> None:
    bench = Bench(views=RING)
    bench.stand(0, 0, 0.3, rate=1.0)
    bench.run(1.0)
    assert bench.output("panorama").n == 0
    bench.stand(0, 0, 0.9)
    bench.run(0.2)
    assert bench.output("panorama").yaw == pytest.approx(0.9)


@pytest.mark.parametrize("views", [(*RING, "down"), ("front", "down")])
def test_a_view_beyond_the_four_is_captured_once(views: tuple[str, ...]) -> None:
    bench = Bench(views=views)
    bench.sweep(0.0, 0.0)
    panorama = bench.output("panorama")
    assert [f.view for f in panorama.frames] == ["front", "left", "back", "right", "down"]
    assert panorama.frame("down").X_WC[:3, 2] == pytest.approx([0, 0, -1], abs=1e-9)
