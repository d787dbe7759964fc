import dataclasses as dc
import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.mapping.voxel_system import VoxelMapper
from unilavira_drake.messages import Frame, Intrinsics, Panorama, VoxelMap

X_BC = RigidTransform(RotationMatrix(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])), [0.1, 0, 0])
X_BD = RigidTransform(RotationMatrix(np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])), [0, 0, 0])
LENS = Intrinsics(24, 18, 16.0, 16.0, 11.5, 8.5)


class Eye(LeafSystem):
    """Two depth cameras in a hall, from the pose on the input; remembers when it drew."""

    def __init__(self, ray_cast):
        super().__init__()
        self.drawn = []
        self._cast = ray_cast
        self.DeclareAbstractInputPort("pose", Value[RigidTransform]())
        for view, X in (("front", X_BC), ("down", X_BD)):
            self.DeclareAbstractOutputPort(
                f"{view}.depth_image",
                lambda: Value[ImageDepth32F](ImageDepth32F(width=24, height=18)),
                lambda context, output, X=X: self._calc(context, output, X),
            )

    def _calc(self, context, output, X):
        X_WB = self.GetInputPort("pose").Eval(context)
        if X is X_BC:
            self.drawn.append(round(context.get_time(), 6))
        image = ImageDepth32F(width=24, height=18)
        X_WC = (X_WB @ X).GetAsMatrix4()
        image.mutable_data[:, :, 0] = self._cast(X_WC, (), intrinsics=LENS)
        output.set_value(image)


class Mover(LeafSystem):
    def __init__(self, pose_of):
        super().__init__()
        self.DeclareAbstractOutputPort(
            "pose",
            lambda: Value[RigidTransform](),
            lambda context, output: output.set_value(pose_of(context.get_time())),
        )


class Bench:
    def __init__(self, pose_of, ray_cast):
        builder = DiagramBuilder()
        self.eye = builder.AddSystem(Eye(ray_cast))
        mover = builder.AddSystem(Mover(pose_of))
        self.mapper = builder.AddSystem(
            VoxelMapper(
                intrinsics={"front": LENS, "down": LENS}, resolution=0.3, max_range=8.0, stride=1
            )
        )
        builder.Connect(mover.get_output_port(), self.eye.GetInputPort("pose"))
        builder.Connect(mover.get_output_port(), self.mapper.GetInputPort("pose_estimate"))
        for view in ("front", "down"):
            port = f"{view}.depth_image"
            builder.Connect(self.eye.GetOutputPort(port), self.mapper.GetInputPort(port))
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.mapper.GetMyMutableContextFromRoot(self.simulator.get_mutable_context())
        for view, X in (("front", X_BC), ("down", X_BD)):
            self.mapper.GetInputPort(f"{view}.X_BC").FixValue(
                self.context, Value[RigidTransform](X)
            )
        self.show(Panorama())

    def show(self, value):
        self.mapper.GetInputPort("panorama").FixValue(self.context, AbstractValue.Make(value))

    def run(self, time):
        self.simulator.AdvanceTo(time)
        return self.mapper.GetOutputPort("voxel_map").Eval(self.context)


def pose(x=0.0, y=0.0, z=1.3, yaw=0.0, pitch=0.0):
    return RigidTransform(RollPitchYaw(0, pitch, yaw), [x, y, z])


def test_at_rest_the_cameras_are_asked_only_now_and_then(ray_cast):
    bench = Bench(lambda t: pose(), ray_cast)
    voxels = bench.run(5.05)
    first = bench.eye.drawn[0]
    assert first < 0.1
    assert bench.eye.drawn == pytest.approx([first, first + 2.0, first + 4.0])
    assert (voxels.n, voxels.version, voxels.rejected) == (0, 3, ())
    assert (voxels.window((13, -1, 2), (14, 1, 6)) > 0).all()
    assert (voxels.window((-1, -1, -1), (1, 1, 0)) > 0).all()
    assert voxels.state((1.0, 0.0, 1.3)) == voxels.state((0.1, 0.1, 0.5)) == "free"


def test_flying_climbing_turning_and_nodding_ask_by_motion(ray_cast):
    for pose_of in (
        lambda t: pose(x=1.0 * t),
        lambda t: pose(z=1.0 + 0.5 * t),
        lambda t: pose(yaw=math.radians(15) * t),
        lambda t: pose(pitch=math.radians(-15) * t),
    ):
        bench = Bench(pose_of, ray_cast)
        bench.run(1.95)
        gaps = np.diff(bench.eye.drawn)
        assert len(gaps) >= 1
        assert gaps.min() > 0.35
        assert gaps.max() < 1.25


def panorama(n, ray_cast, X_WB):
    X_WC = (X_WB @ X_BC).GetAsMatrix4()
    depth = ray_cast(X_WC, (), intrinsics=LENS)
    frame = Frame(depth=depth, intrinsics=LENS, X_WC=X_WC)
    return Panorama(n=n, first=n, X_WB=X_WB.GetAsMatrix4(), frames=(frame,))


def test_a_panorama_is_integrated_once_and_a_reissued_one_renews_the_number(ray_cast):
    bench = Bench(lambda t: pose(), ray_cast)
    bench.run(0.05)
    first = panorama(1, ray_cast, pose(yaw=2.0))
    bench.show(first)
    before = bench.run(0.15)
    assert (before.n, before.version, len(bench.eye.drawn)) == (1, 2, 1)
    bench.show(dc.replace(first, n=2))
    after = bench.run(0.25)
    assert (after.n, after.version) == (2, 2)
    assert all(after.tiles[key] is tile for key, tile in before.tiles.items())


def test_a_cloned_context_has_the_same_future(ray_cast):
    bench = Bench(lambda t: pose(x=0.5 * t, yaw=0.4 * t), ray_cast)
    bench.run(1.05)
    branch = Simulator(bench.diagram, bench.simulator.get_context().Clone())
    branch.AdvanceTo(3.0)
    context = bench.mapper.GetMyContextFromRoot(branch.get_context())
    other = bench.mapper.GetOutputPort("voxel_map").Eval(context)
    voxels = bench.run(3.0)
    assert voxels.version == other.version
    assert list(voxels.tiles) == list(other.tiles)
    assert all((voxels.tiles[key] == tile).all() for key, tile in other.tiles.items())


def test_alone_it_maps_what_a_panorama_shows(ray_cast):
    mapper = VoxelMapper(
        intrinsics={},
        resolution=0.3,
        max_range=8.0,
        stride=1,
        min_altitude=0.5,
        max_altitude=9.0,
    )
    context = mapper.CreateDefaultContext()
    mapper.GetInputPort("pose_estimate").FixValue(context, Value[RigidTransform](pose()))
    mapper.GetInputPort("panorama").FixValue(
        context, AbstractValue.Make(panorama(3, ray_cast, pose()))
    )
    simulator = Simulator(mapper, context)
    simulator.AdvanceTo(3.0)
    voxels = mapper.GetOutputPort("voxel_map").Eval(context)
    assert (voxels.n, voxels.version) == (3, 1)
    assert voxels.altitudes == (0.5, 9.0)
    assert (voxels.window((13, -1, 2), (14, 1, 6)) > 0).all()


def garbage(rng):
    """A frame in which anything may be wrong."""
    shape = [(18, 24), (18, 24), (18, 24), (3, 5), (0, 24), (18, 24, 1)][rng.integers(6)]
    kind = [np.float32, np.float32, np.float64, np.int16, np.complex64, bool][rng.integers(6)]
    with np.errstate(invalid="ignore", over="ignore"):
        depth = rng.normal(2.0, 3.0, shape).astype(kind)
        if depth.dtype.kind == "f":
            spots = rng.random(shape)
            for k, value in enumerate((0.0, np.nan, np.inf, -np.inf, 1e30, 65.535)):
                depth[(spots > 0.1 * k) & (spots < 0.1 * k + 0.05)] = value
    X_WC = (pose(*rng.uniform(-50, 50, 2), 1.0, *rng.uniform(-3, 3, 2)) @ X_BC).GetAsMatrix4()
    wrong = rng.integers(8)
    if wrong < 3:
        X_WC[rng.integers(4), rng.integers(4)] = (np.nan, np.inf, 1e300)[wrong]
    elif wrong == 3:
        X_WC = rng.normal(size=[(4, 4), (3, 4), (16,)][rng.integers(3)])
    values = rng.choice([16.0, 11.5, 0.0, -3.0, np.nan, np.inf, 1e300], 4, p=[0.7] + [0.05] * 6)
    lens = Intrinsics(24, 18, *values) if rng.random() < 0.5 else LENS
    return Frame(depth=depth, intrinsics=lens, X_WC=X_WC)


def test_ten_thousand_frames_of_garbage_never_raise_and_are_named():
    mapper = VoxelMapper(intrinsics={"front": LENS}, resolution=0.5, max_range=20.0, stride=2)
    context = mapper.CreateDefaultContext()
    rng = np.random.default_rng(1)
    mapper.GetInputPort("front.X_BC").FixValue(context, Value[RigidTransform](X_BC))
    taken = left = 0
    for n in range(1, 1001):
        X_WB = RigidTransform(rng.choice([0.0, np.nan, np.inf, 1e300], 3, p=[0.4, 0.2, 0.2, 0.2]))
        frames = tuple(garbage(rng) for _ in range(9))
        image = ImageDepth32F(width=24, height=18)
        image.mutable_data[:, :, 0] = rng.choice([np.nan, np.inf, 0.0, -1.0, 3.0], (18, 24))
        for name, value in (
            ("pose_estimate", Value[RigidTransform](X_WB)),
            ("front.depth_image", Value[ImageDepth32F](image)),
            ("panorama", AbstractValue.Make(Panorama(n=n, first=n, frames=frames))),
        ):
            mapper.GetInputPort(name).FixValue(context, value)
        state = mapper.step(context, mapper.state(context))
        context.SetAbstractState(0, state)
        left += len(state.voxels.rejected)
        taken += 9 - len(state.voxels.rejected)
        assert state.voxels.n == n
        assert all(words.startswith("view ") for words in state.voxels.rejected)
        context.SetTime(3.0 * n)
        state = mapper.step(context, state)
        assert bool(state.voxels.rejected) == (not np.abs(X_WB.translation()).max() <= 1e6)
        context.SetAbstractState(0, state)
    assert taken > 900
    assert left > 3000
    assert len(state.voxels.tiles) > 10


def test_cameras_are_given_by_name():
    mapper = VoxelMapper(intrinsics={"front": LENS, "down": LENS})
    names = [mapper.get_input_port(k).get_name() for k in range(mapper.num_input_ports())]
    assert names == [
        "panorama",
        "front.depth_image",
        "front.X_BC",
        "down.depth_image",
        "down.X_BC",
        "pose_estimate",
    ]
    default = mapper.GetOutputPort("voxel_map").Allocate().get_value()
    assert isinstance(default, VoxelMap)
    assert default.resolution == 0.5
    with pytest.raises(ValueError, match="voxels"):
        VoxelMapper(intrinsics={}, resolution=0.01)
