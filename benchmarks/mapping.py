"""CPU of the occupancy map: a depth image taken in, beside numpy and on maps of several sizes.

    python benchmarks/mapping.py [--world apartment] [--views 24] [--rounds 3]

Prints one JSON object a line.  Depth images of 640x480 are rendered in a furnished world from
places where a robot could stand.  Ours and the peer take in the same image in turn in one process,
in changing order; the value is the median of the ratio of their CPU times over all images, in
rounds.  Both begin with a map of the same known cells, and end with the same log-odds in each cell;
that is checked.

The peer is vectorised numpy (``mapping_peers.py``) on one dense grid in place.  It does the same
work at the same stride: height band, range, drops, hits counted, free space carved by bearing.
Ours gives a new frozen map each time, besides.
"""

from __future__ import annotations

import argparse
import functools
import math
import statistics
from collections.abc import Callable
from typing import Any

import numpy as np
from cost import cpu_ms
from mapping_peers import Splat
from pydrake.math import RigidTransform, RollPitchYaw
from rendering import DEPTH, Bench, row

from unilavira_drake.mapping.depth_scan import warm_up
from unilavira_drake.mapping.depth_view import DepthView
from unilavira_drake.mapping.occupancy import MappingParameters, integrate
from unilavira_drake.messages import OccupancyMap
from unilavira_drake.sensors.rig import pinhole

CAMERA_HEIGHT, PITCH = 1.0, math.radians(10.0)
SIDES = (480, 960, 2000)
TILE = 64


def rendered(world: str, count: int) -> list[DepthView]:
    """Returns depth images from places with room around the camera."""
    bench = Bench(world, cameras=("raster",))
    lens = pinhole(640, 480, 79.0)
    rng = np.random.default_rng(1)
    assert bench.world is not None
    turn = RollPitchYaw(-math.pi / 2, 0, -math.pi / 2).ToRotationMatrix()
    views: list[DepthView] = []
    while len(views) < count:
        room = bench.world.rooms[rng.integers(len(bench.world.rooms))].rectangle
        place: Any = [*rng.uniform(room[:2], room[2:]), CAMERA_HEIGHT]
        level = RollPitchYaw(0.0, PITCH, rng.uniform(-math.pi, math.pi)).ToRotationMatrix()
        X_WC = RigidTransform(level.multiply(turn), place)
        bench.look(X_WC)
        depth = bench.pull("raster", DEPTH)[0][:, :, 0].copy()
        if depth.min() > 0.4:
            depth.flags.writeable = False
            views.append(DepthView(depth, lens, X_WC.GetAsMatrix4()))
    return views


def known_map(side: int, parameters: MappingParameters, center: tuple[float, float]) -> Any:
    """Returns a map whose cells are all known, about a point, and its row and column there."""
    rng = np.random.default_rng(2)
    cells = rng.choice(np.array([-40, -20, 20, 40], np.int8), (side, side), p=[0.5, 0.3, 0.1, 0.1])
    first = [round(center[axis] / parameters.resolution) - side // 2 for axis in (1, 0)]
    first = [value // TILE * TILE for value in first]
    origin = (first[1] * parameters.resolution, first[0] * parameters.resolution)
    return OccupancyMap(
        version=1, resolution=parameters.resolution, origin=origin, log_odds=cells
    ), (first[0], first[1])


def middle(views: list[DepthView]) -> tuple[float, float]:
    """Returns the middle of all cameras."""
    x, y = np.mean([view.X_WC[:2, 3] for view in views], axis=0).tolist()
    return x, y


class Ours:
    """The map as a chain of frozen maps."""

    def __init__(self, occupancy: OccupancyMap, parameters: MappingParameters) -> None:
        self.occupancy, self.parameters = occupancy, parameters

    def integrate(self, view: DepthView) -> None:
        """Takes in one view; the robot has no footprint, as the peer has none."""
        x, y = view.X_WC[:2, 3].tolist()
        self.occupancy = integrate(
            self.occupancy,
            [view],
            parameters=self.parameters,
            position=(x, y),
            floor_height=0.0,
            n=0,
            time=0.0,
        )


def in_turn(
    views: list[DepthView], rounds: int, one: Callable[[DepthView], Any], other: Any
) -> list[tuple[float, float]]:
    """Returns the CPU milliseconds of both for each view, in changing order."""
    spent = []
    for index, view in enumerate(views * (rounds + 1)):
        # The renderer has just written the image.
        view.depth.sum()
        order = (0, 1) if index % 2 else (1, 0)
        took = {k: cpu_ms(functools.partial((one, other)[k], view)) for k in order}
        if index >= len(views):
            spent.append((took[0], took[1]))
    return spent


def ratio_row(id_: str, what: str, spent: list[tuple[float, float]], **more: Any) -> None:
    """Prints the median of the second over the first."""
    quotients = sorted(b / a for a, b in spent)
    ours, other = (statistics.median(column) for column in zip(*spent, strict=True))
    row(id_, what, statistics.median(quotients), "x", n=len(quotients),
        p10=round(quotients[len(quotients) // 10], 2),
        p90=round(quotients[-1 - len(quotients) // 10], 2),
        ours_ms=round(ours, 3), other_ms=round(other, 3), **more)  # fmt: skip


def beside_numpy(views: list[DepthView], rounds: int) -> None:
    """Prints by how much less CPU an image costs than in numpy, at several strides."""
    for stride, target in ((1, 5.0), (2, None), (3, None)):
        parameters = MappingParameters(stride=stride, footprint_radius=0.0)
        occupancy, first = known_map(960, parameters, middle(views))
        ours = Ours(occupancy, parameters)
        peer = Splat(occupancy.log_odds.copy(), first, parameters)
        spent = in_turn(views, rounds, ours.integrate, lambda v, p=peer: p.integrate(v, 0.0))
        (i, j), (rows, columns) = ours.occupancy.cells.first, occupancy.shape
        inner = ours.occupancy.window(
            (first[0] - i, first[1] - j), (first[0] - i + rows, first[1] - j + columns)
        )
        assert np.array_equal(inner, peer.log_odds), "the peer must do the same work"
        ratio_row(f"T5.stride{stride}", f"a 640x480 depth image at stride {stride} / numpy",
                  spent, target=target)  # fmt: skip


def sizes(views: list[DepthView], rounds: int) -> None:
    """Prints what an image costs on larger maps, over what it costs on 480 x 480 known cells."""
    parameters = MappingParameters(stride=3)
    for side in SIDES[1:]:
        small, large = (
            Ours(known_map(s, parameters, middle(views))[0], parameters) for s in (SIDES[0], side)
        )
        spent = in_turn(views, rounds, small.integrate, large.integrate)
        target = 1.2 if side == SIDES[-1] else None
        ratio_row(f"T5.size{side}", f"on {side}^2 known cells / on {SIDES[0]}^2, stride 3",
                  spent, target=target, sense="<=")  # fmt: skip


def far_apart(views: list[DepthView], rounds: int) -> None:
    """Prints what tiles cost in memory when the robot is carried far away."""
    parameters = MappingParameters(stride=3)
    ours = Ours(OccupancyMap(), parameters)
    for number, view in enumerate(views):
        X_WC = view.X_WC.copy()
        X_WC[0, 3] += 10_000.0 * (number % 2)
        ours.integrate(DepthView(view.depth, view.intrinsics, X_WC))
    tiles = ours.occupancy.cells.tiles
    row("T5.far", "memory of the cells after a jump of 10 km", len(tiles) * TILE**2 / 2**20, "MB",
        tiles=len(tiles), frame=ours.occupancy.shape)  # fmt: skip


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--world", default="apartment", help="furnished world")
    parser.add_argument("--views", type=int, default=24, help="depth images")
    parser.add_argument("--rounds", type=int, default=3, help="how often each is taken in")
    arguments = parser.parse_args()
    warm_up()
    views = rendered(arguments.world, max(arguments.views, 15))
    beside_numpy(views, arguments.rounds)
    sizes(views, arguments.rounds)
    far_apart(views, arguments.rounds)


if __name__ == "__main__":
    main()
