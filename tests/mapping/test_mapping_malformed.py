"""Ten thousand depth images, cameras and poses that no sensor should give, and some do."""

import dataclasses as dc
import math

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.mapping.depth_scan import LIMIT
from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MAX_FRAME, MappingParameters, integrate
from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.messages import Frame, Intrinsics, OccupancyMap, Panorama

LENS = Intrinsics(16, 12, 9.0, 9.0, 7.5, 5.5)
PARAMETERS = MappingParameters(resolution=0.1, max_range=3.0, stride=1)
NUMBERS = (math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1e-300, -1e-300, 1e300, -1e300, 1e-40,
           3e38, 1e9, 65.535, 2.0)  # fmt: skip
R_BC = RotationMatrix(np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]))
SHAPES = ((0, 16), (12, 0), (12,), (12, 16, 1), (11, 16), (16, 12), (1, 1), ())


def number(rng):
    return float(rng.choice(NUMBERS))


def odd_depth(rng):
    """A depth image: of nonsense, of odd shape, of odd type, or a good one."""
    depth = rng.uniform(0.2, 5.0, (12, 16)).astype(np.float32)
    kind = rng.integers(7)
    if kind == 0:
        holes = rng.random(depth.shape) < rng.random()
        with np.errstate(over="ignore"):
            values = np.array(NUMBERS).astype(np.float32)
        depth = np.where(holes, rng.choice(values, depth.shape), depth)
    elif kind == 1:
        depth = np.full((12, 16), number(rng))
    elif kind == 2:
        depth = np.full(SHAPES[rng.integers(len(SHAPES))], 2.0, np.float32)
    elif kind == 3:
        depth = depth.astype(rng.choice(["int16", "uint8", "bool", "complex64", "float16"]))
    elif kind == 4:
        depth = depth[::-1, ::-1]
    return depth


def odd_lens(rng):
    """Intrinsics with a number of nonsense, of another size, or the right ones."""
    if rng.random() < 0.6:
        return LENS
    name = str(rng.choice(["fx", "fy", "cx", "cy", "width", "height"]))
    value = int(rng.integers(-2, 20)) if name in ("width", "height") else number(rng)
    return dc.replace(LENS, **{name: value})


def odd_pose(rng):
    """A pose of the camera: no pose, somewhere else, in any attitude, or a good one."""
    R = RollPitchYaw(*rng.uniform(-0.4, 0.4, 2), rng.uniform(-3, 3)).ToRotationMatrix()
    X_WC = RigidTransform(R @ R_BC, [*rng.uniform(-2, 2, 2), 0.9]).GetAsMatrix4()
    kind = rng.integers(7)
    if kind == 0:
        X_WC[rng.integers(4), rng.integers(4)] = number(rng)
    elif kind == 1:
        X_WC[:3, :3] = rng.normal(size=(3, 3))
    elif kind == 2:
        X_WC = (X_WC[:3], X_WC.astype(int), np.zeros((4, 4)), X_WC[0], -X_WC)[rng.integers(5)]
    elif kind == 3:
        q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        X_WC[:3, :3] = q
    elif kind == 4:
        X_WC[:2, 3] += rng.choice([30.0, 1e3, 1e5, 1e6, 2e6])
    return X_WC


def odd_place(rng):
    """Where the robot stands: position, floor height and up."""
    position, floor_height, up = rng.uniform(-1, 1, 2).tolist(), 0.0, [0.0, 0.0, 1.0]
    kind = rng.integers(8)
    if kind == 0:
        position[rng.integers(2)] = number(rng)
    elif kind == 1:
        floor_height = number(rng)
    elif kind == 2:
        up[rng.integers(3)] = number(rng)
    elif kind == 3:
        up = (rng.normal(size=3) / 2.0).tolist()
    elif kind == 4:
        position[0] += float(rng.choice([50.0, 1e4, 9e5]))
    return {"position": tuple(position), "floor_height": floor_height, "up": tuple(up)}


def check(before, after, views):
    """Either nothing changed, or what changed is a map."""
    assert all(isinstance(reason, str) and reason for reason in after.rejected)
    assert len(after.rejected) <= views
    if after.version == before.version:
        assert after.cells is before.cells
        assert after.time == before.time
        return
    assert after.version == before.version + 1
    assert max(after.shape) <= MAX_FRAME
    old = before.cells.tiles if before.version else {}
    new = [tile for key, tile in after.cells.tiles.items() if old.get(key) is not tile]
    assert len(new) <= 4 * (views + 1)
    for tile in new:
        assert np.abs(tile.astype(int)).max() <= LIMIT
        assert not tile.flags.writeable


def test_integration_survives_nine_thousand_of_them():
    rng = np.random.default_rng(7)
    occupancy, changed, told = OccupancyMap(), 0, set()
    for count in range(9000):
        views = [DepthView(odd_depth(rng), odd_lens(rng), odd_pose(rng))
                 for _ in range(rng.integers(1, 3))]  # fmt: skip
        before = occupancy
        occupancy = integrate(
            before, views, parameters=PARAMETERS, n=count, time=float(count), **odd_place(rng)
        )
        check(before, occupancy, len(views))
        assert occupancy.n == count
        changed += occupancy.version > before.version
        told |= {reason[len("view 0: ") :][:20] for reason in occupancy.rejected}
        if len(occupancy.cells.tiles) > 200:
            occupancy = OccupancyMap()
    assert changed > 1500
    assert len(told) > 5


def odd_image(rng):
    """What a camera's port may carry: an image of any size and any numbers."""
    depth = np.atleast_2d(odd_depth(rng))[:12, :16]
    if depth.ndim != 2 or depth.dtype.kind != "f" or depth.size == 0:
        depth = np.full((rng.integers(1, 20), rng.integers(1, 20)), 2.0)
    image = ImageDepth32F(width=depth.shape[1], height=depth.shape[0])
    with np.errstate(over="ignore", invalid="ignore"):
        image.mutable_data[:, :, 0] = depth
    return image


def odd_transform(rng, base):
    """A pose of the base, or of the camera on it, with now and then a number of nonsense."""
    translation = [*rng.uniform(-1, 1, 2), 0.0 if base else 0.9]
    if rng.random() < 0.2:
        translation[rng.integers(3)] = number(rng)
    tilt = rng.uniform(-1.7, 1.7, 2) if rng.random() < 0.2 else (0.0, 0.0)
    R = RollPitchYaw(*tilt, rng.uniform(-3, 3)).ToRotationMatrix()
    return RigidTransform(R if base else R @ R_BC, translation)


def odd_panorama(rng, n):
    """A panorama of views of nonsense."""
    frames = tuple(
        Frame(view="front", depth=odd_depth(rng), intrinsics=odd_lens(rng), X_WC=odd_pose(rng))
        for _ in range(rng.integers(0, 5))
    )
    X_WB = odd_transform(rng, base=True).GetAsMatrix4()
    return Panorama(n=n, first=n - int(rng.integers(2)), X_WB=X_WB, frames=frames)


def test_the_mapper_survives_a_thousand_of_them():
    rng = np.random.default_rng(11)
    builder = DiagramBuilder()
    mapper = builder.AddSystem(
        OccupancyMapper(intrinsics=LENS, resolution=0.1, max_range=3.0, stride=1, travel=0.05)
    )
    simulator = Simulator(builder.Build())
    context = mapper.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    names = ("panorama", "front.depth_image", "front.X_BC", "pose_estimate")
    ports = {name: mapper.GetInputPort(name) for name in names}
    n, previous, changed = 0, OccupancyMap(), 0
    for tick in range(1000):
        n += int(rng.random() < 0.3)
        ports["panorama"].FixValue(context, AbstractValue.Make(odd_panorama(rng, n)))
        ports["front.depth_image"].FixValue(context, Value[ImageDepth32F](odd_image(rng)))
        for name, base in (("front.X_BC", False), ("pose_estimate", True)):
            ports[name].FixValue(context, Value[RigidTransform](odd_transform(rng, base)))
        simulator.AdvanceTo(0.1 * tick + 0.05)
        occupancy = mapper.GetOutputPort("map").Eval(context)
        assert occupancy.n == n
        assert occupancy.version >= previous.version
        assert max(occupancy.shape) <= MAX_FRAME
        changed += occupancy.version > previous.version
        previous = occupancy
    assert changed > 200
