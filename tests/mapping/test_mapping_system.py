import dataclasses as dc
import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.messages import DIRECTIONS, VIEW_YAW, Frame, Panorama

X_BC = RigidTransform(RotationMatrix(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])), [0, 0, 0.88])


class Camera(LeafSystem):
    """Depth of a hall from the pose on its input; remembers when it was rendered."""

    def __init__(self, intrinsics, ray_cast):
        super().__init__()
        self.rendered = []
        self._cast = ray_cast
        self._intrinsics = intrinsics
        self.DeclareAbstractInputPort("pose", Value[RigidTransform]())
        self.DeclareAbstractOutputPort(
            "front.depth_image",
            lambda: Value[ImageDepth32F](
                ImageDepth32F(width=intrinsics.width, height=intrinsics.height)
            ),
            self._calc,
        )

    def _calc(self, context, output):
        X_WB = self.GetInputPort("pose").Eval(context)
        self.rendered.append(round(context.get_time(), 6))
        image = ImageDepth32F(width=self._intrinsics.width, height=self._intrinsics.height)
        image.mutable_data[:, :, 0] = self._cast((X_WB @ X_BC).GetAsMatrix4(), ())
        output.set_value(image)


class Mover(LeafSystem):
    """Pose as a function of time."""

    def __init__(self, pose_of):
        super().__init__()
        self.DeclareAbstractOutputPort(
            "pose",
            lambda: Value[RigidTransform](),
            lambda context, output: output.set_value(pose_of(context.get_time())),
        )


def planar(x, y, yaw):
    return RigidTransform(RollPitchYaw(0, 0, yaw), [x, y, 0])


def panorama(n, X_WB, intrinsics, ray_cast):
    frames = []
    for view in DIRECTIONS:
        turned = X_WB @ RigidTransform(RollPitchYaw(0, 0, VIEW_YAW[view]), [0, 0, 0])
        X_WC = (turned @ X_BC).GetAsMatrix4()
        frames.append(Frame(view=view, depth=ray_cast(X_WC, ()), intrinsics=intrinsics, X_WC=X_WC))
    return Panorama(n=n, first=n, X_WB=X_WB.GetAsMatrix4(), frames=tuple(frames))


class Bench:
    def __init__(self, pose_of, intrinsics, ray_cast):
        builder = DiagramBuilder()
        self.camera = builder.AddSystem(Camera(intrinsics, ray_cast))
        mover = builder.AddSystem(Mover(pose_of))
        self.mapper = builder.AddSystem(OccupancyMapper(intrinsics=intrinsics, stride=1))
        builder.Connect(mover.get_output_port(), self.camera.GetInputPort("pose"))
        builder.Connect(mover.get_output_port(), self.mapper.GetInputPort("pose_estimate"))
        builder.Connect(
            self.camera.get_output_port(), self.mapper.GetInputPort("front.depth_image")
        )
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.mapper.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        self.mapper.GetInputPort("front.X_BC").FixValue(self.context, Value[RigidTransform](X_BC))
        self.show(Panorama())

    def show(self, value):
        self.mapper.GetInputPort("panorama").FixValue(self.context, AbstractValue.Make(value))

    def run(self, time):
        self.simulator.AdvanceTo(time)
        return self.mapper.GetOutputPort("map").Eval(self.context)


def test_at_rest_the_camera_is_asked_only_now_and_then(intrinsics, ray_cast):
    bench = Bench(lambda t: planar(0, 0, 0), intrinsics, ray_cast)
    occupancy = bench.run(7.05)
    first = bench.camera.rendered[0]
    assert first < 0.1
    assert bench.camera.rendered == pytest.approx([first, first + 2.0, first + 4.0, first + 6.0])
    assert (occupancy.n, occupancy.version) == (0, 4)
    assert occupancy.time == bench.camera.rendered[-1]


def test_driving_and_turning_ask_by_motion(intrinsics, ray_cast):
    bench = Bench(lambda t: planar(0.5 * t, 0, 0), intrinsics, ray_cast)
    bench.run(2.05)
    assert np.diff(bench.camera.rendered) == pytest.approx(np.full(6, 0.3), abs=0.11)
    bench = Bench(lambda t: planar(0, 0, math.radians(60) * t), intrinsics, ray_cast)
    bench.run(2.05)
    assert np.diff(bench.camera.rendered) == pytest.approx(np.full(6, 0.3), abs=0.06)


def test_a_panorama_is_integrated_without_the_camera(intrinsics, ray_cast):
    bench = Bench(lambda t: planar(0, 0, 0), intrinsics, ray_cast)
    bench.run(0.05)
    bench.show(panorama(1, planar(0, 0, 0), intrinsics, ray_cast))
    occupancy = bench.run(0.15)
    assert len(bench.camera.rendered) == 1
    assert (occupancy.n, occupancy.version) == (1, 2)
    for x, y in ((3.0, 0.0), (-0.5, 0.1), (0.2, 2.0), (0.0, -1.2)):
        assert occupancy.log_odds[occupancy.cell(x, y)] < 0
    for x, y in ((4.02, 0.02), (-1.02, 0.02), (0.02, 3.02), (0.02, -1.52)):
        assert occupancy.log_odds[occupancy.cell(x, y)] > 0


def test_a_reissued_panorama_only_renews_the_number(intrinsics, ray_cast):
    bench = Bench(lambda t: planar(0, 0, 0), intrinsics, ray_cast)
    first = panorama(1, planar(0, 0, 0), intrinsics, ray_cast)
    bench.show(first)
    before = bench.run(0.05)
    bench.show(dc.replace(first, n=2))
    after = bench.run(0.15)
    assert (after.n, after.version) == (2, before.version)
    assert after.log_odds is before.log_odds


def test_a_panorama_missed_under_its_first_number_is_still_integrated(intrinsics, ray_cast):
    bench = Bench(lambda t: planar(0, 0, 0), intrinsics, ray_cast)
    bench.run(0.05)
    bench.show(dc.replace(panorama(3, planar(0, 0, 0), intrinsics, ray_cast), n=5))
    occupancy = bench.run(0.15)
    assert (occupancy.n, occupancy.version) == (5, 2)
    assert occupancy.log_odds[occupancy.cell(-1.02, 0.02)] > 0


def test_a_cloned_context_has_the_same_future(intrinsics, ray_cast):
    bench = Bench(lambda t: planar(0.3 * t, 0, 0.5 * t), intrinsics, ray_cast)
    bench.run(1.05)
    branch = Simulator(bench.diagram, bench.simulator.get_context().Clone())
    branch.AdvanceTo(3.0)
    context = bench.mapper.GetMyContextFromRoot(branch.get_context())
    other = bench.mapper.GetOutputPort("map").Eval(context)
    occupancy = bench.run(3.0)
    assert occupancy.version == other.version
    assert occupancy.log_odds.tobytes() == other.log_odds.tobytes()


def on_floor(x, z, yaw=0.0, pitch=0.0):
    return RigidTransform(RollPitchYaw(0, pitch, yaw), [x, 0, z])


def test_each_storey_has_its_map_and_versions_go_on_counting(intrinsics, ray_cast):
    """Up a lift at 5 s, and down again at 10 s; the camera sees the same hall on both storeys."""

    def height(t):
        return 3.0 if 5.0 <= t < 10.0 else 0.0

    bench = Bench(lambda t: on_floor(0.3 * math.sin(t), height(t)), intrinsics, ray_cast)
    bench.camera._cast = lambda X_WC, boxes: ray_cast(
        np.vstack((X_WC[:2], [[*X_WC[2, :3], 0.88]], X_WC[3:])), boxes
    )
    ground = bench.run(4.9)
    assert [s.height for s in bench.mapper.storeys(bench.context)] == [0.0]
    versions = [ground.version]
    for time in np.arange(5.0, 15.0, 0.1):
        versions.append(bench.run(float(time)).version)
    assert versions == sorted(versions)
    storeys = bench.mapper.storeys(bench.context)
    assert [s.height for s in storeys] == [0.0, 3.0]
    below, above = (s.occupancy for s in storeys)
    assert bench.run(15.0).cells is below.cells
    known = above.log_odds != 0
    assert known.sum() > 1000
    assert np.mean(np.sign(above.log_odds[known]) == np.sign(below.log_odds[known])) > 0.95
    assert above.cells.tiles.keys() <= below.cells.tiles.keys()


def test_a_slope_is_floor_to_a_robot_that_tilts_with_it(intrinsics, ray_cast):
    """The hall lies on a ramp of 1:6, and so does the robot."""
    X_WP = RigidTransform(RollPitchYaw(0.0, -math.atan(1 / 6), 0.0), [0.0, 0.0, 0.5])
    bench = Bench(lambda t: X_WP @ planar(0, 0, 0), intrinsics, ray_cast)
    bench.camera._cast = lambda X_WC, boxes: ray_cast(X_WP.inverse().GetAsMatrix4() @ X_WC, boxes)
    occupancy = bench.run(0.15)
    assert all(occupancy.state_at(x, 0.02) == "free" for x in (1.5, 2.5, 3.5))
    # The wall leans towards the robot.
    states = {occupancy.state_at(x, 0.02) for x in np.arange(3.7, 4.0, 0.05)}
    assert "occupied" in states


def test_nonsense_leaves_the_map_and_is_told(intrinsics, ray_cast):
    lost = [False]
    bench = Bench(
        lambda t: planar(math.nan if lost[0] else 0.0, 0, 0),
        intrinsics,
        lambda X, b: ray_cast(X, b),
    )
    before = bench.run(1.0)
    assert before.rejected == ()
    lost[0] = True
    after = bench.run(4.5)
    assert after.cells is before.cells
    assert (after.version, after.time) == (before.version, before.time)
    assert after.rejected == ("view 0: the robot's position is not finite, or beyond 1e+06 m",)
    # A sweep is counted, or the ring would wait for it for ever; a bad frame in it is left out.
    lost[0] = False
    seen = panorama(1, planar(0, 0, 0), intrinsics, ray_cast)
    broken = dc.replace(seen.frames[1], depth=np.zeros((3, 4), np.float32))
    bench.show(dc.replace(seen, frames=(seen.frames[0], broken, *seen.frames[2:])))
    told = bench.run(4.65)
    assert (told.n, told.version) == (1, before.version + 1)
    assert told.rejected == ("view 1: the depth image is 4 x 3, its intrinsics 160 x 120",)
    bench.show(dc.replace(seen, n=2, first=2, frames=(broken,) * 4))
    kept = bench.run(4.75)
    assert (kept.n, kept.version, len(kept.rejected)) == (2, told.version, 4)
    assert kept.cells is told.cells
