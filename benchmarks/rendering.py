"""CPU of pictures: the raster camera beside Drake's VTK renderer.

    python benchmarks/rendering.py [--world apartment] [--poses 200] [--leaks]

Prints one JSON object a line.  Both cameras stand in one diagram, take the same picture in turn,
and are compared by the CPU time of the process, all threads: the value is the median of the ratio
over the poses.  Run it on a quiet machine with as many rendering threads as an episode would have
(``LP_NUM_THREADS=1``).

For comparison, habitat-sim 0.3 took 8.6 ms for colour and depth of a furnished room without light
and 3.1 ms for a plain one, at 640x480 on two cores without a GPU.
"""

from __future__ import annotations

import argparse
import functools
import importlib
import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from cost import cpu_and_memory, cpu_ms, resident_mb
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    MakeRenderEngineVtk,
    RenderCameraCore,
    RenderEngineVtkParams,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.sensors import CameraInfo, RgbdSensor
from scenes import ROOM, add_shapes

from unilavira_drake.planning.plan import warm_up
from unilavira_drake.raster import RasterCameraConfig, RasterView, add_raster_camera, suns_of
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import add_scenery, lights

IMAGES = ("color_image", "depth_image_32f", "label_image")
DEPTH = IMAGES[1:2]
BUILDS = 9  # Processes that build a scene with each camera, in turn.


class Bystander(LeafSystem):
    """Does nothing."""


class Bench:
    """A scene with one or both cameras on a body that is moved.

    Args:
        world: name or file; empty for one of every primitive shape.
        size: width and height, pixels.
        views: how many, all around.
        cameras: of ``raster``, ``vtk`` and ``bystander``, an empty System written in Python.
    """

    def __init__(
        self,
        world: str,
        size: tuple[int, int] = (640, 480),
        views: int = 1,
        cameras: tuple[str, ...] = ("raster", "vtk"),
    ) -> None:
        builder = DiagramBuilder()
        self.plant, graph = AddMultibodyPlantSceneGraph(builder, 0.01)
        origin: Any = np.zeros(3)
        self.body = self.plant.AddRigidBody("C", SpatialInertia(1.0, origin, UnitInertia(1, 1, 1)))
        self.world = load_world(world) if world else None
        textured = False
        if self.world is not None:
            add_scenery(self.plant, graph, self.world)
            textured = self.world.textured
        else:
            add_shapes(self.plant, graph)
        self.plant.Finalize()
        frame = self.plant.GetBodyFrameIdOrThrow(self.body.index())
        focal = size[0] / 2.0 / math.tan(math.radians(79.0) / 2.0)
        core = RenderCameraCore(
            "vtk",
            CameraInfo(*size, focal, focal, size[0] / 2, size[1] / 2),
            ClippingRange(0.05, 40.0),
            RigidTransform(),
        )
        depth = DepthRange(0.1, 10.0)
        names = [f"view_{index}" for index in range(views)]
        X_BC = [
            RigidTransform(RollPitchYaw(0, 2 * math.pi * i / views, 0), origin)
            for i in range(views)
        ]
        self.ports: dict[str, list[tuple[Any, str]]] = {"raster": [], "vtk": []}
        if "bystander" in cameras:
            builder.AddSystem(Bystander())
        if "raster" in cameras:
            rig = tuple(
                RasterView(frame, X, core, depth, name) for X, name in zip(X_BC, names, strict=True)
            )
            camera = add_raster_camera(
                builder, graph, RasterCameraConfig(rig, light=suns_of(lights()))
            )
            self.ports["raster"] = [(camera, f"{name}.") for name in names]
        if "vtk" in cameras:
            parameters = RenderEngineVtkParams(backend="EGL", lights=lights(textured=textured))
            graph.AddRenderer("vtk", MakeRenderEngineVtk(parameters))
            for X in X_BC:
                sensor: Any = builder.AddSystem(
                    RgbdSensor(frame, X, ColorRenderCamera(core), DepthRenderCamera(core, depth))
                )
                builder.Connect(graph.get_query_output_port(), sensor.query_object_input_port())
                self.ports["vtk"].append((sensor, ""))
        self.diagram = builder.Build()
        self.context = self.diagram.CreateDefaultContext()

    def poses(self, count: int, seed: int) -> Iterator[RigidTransform]:
        """Yields random camera poses inside the rooms."""
        rng = np.random.default_rng(seed)
        turn = RollPitchYaw(-math.pi / 2, 0, -math.pi / 2).ToRotationMatrix()
        for _ in range(count):
            x_min, y_min, x_max, y_max = -1.0, -1.0, 1.0, 1.0
            if self.world is not None:
                rooms = self.world.rooms
                x_min, y_min, x_max, y_max = rooms[rng.integers(len(rooms))].rectangle
            R = RollPitchYaw(0, rng.uniform(-0.2, 0.3), rng.uniform(-math.pi, math.pi))
            p: Any = rng.uniform((x_min + 0.3, y_min + 0.3, 0.5), (x_max - 0.3, y_max - 0.3, 1.6))
            yield RigidTransform(R.ToRotationMatrix().multiply(turn), p)

    def look(self, X: RigidTransform) -> None:
        """Moves the cameras, and lets the plant say where they are."""
        plant_context = self.plant.GetMyMutableContextFromRoot(self.context)
        self.plant.SetFreeBodyPose(plant_context, self.body, X)
        self.plant.EvalBodyPoseInWorld(plant_context, self.body)

    def pull(self, camera: str, images: tuple[str, ...] = IMAGES) -> list[Any]:
        """Returns the pixels of all views."""
        return [
            system.GetOutputPort(prefix + image)
            .Eval(system.GetMyContextFromRoot(self.context))
            .data
            for system, prefix in self.ports.get(camera, ())
            for image in images
        ]

    def times(self, images: tuple[str, ...], count: int) -> tuple[list[float], list[float]]:
        """Returns CPU milliseconds of the raster camera and of VTK over random poses."""
        spent: dict[str, list[float]] = {"raster": [], "vtk": []}
        for index, X in enumerate(self.poses(count + 3, 7)):
            self.look(X)
            for camera in ("raster", "vtk") if index % 2 else ("vtk", "raster"):
                took = cpu_ms(functools.partial(self.pull, camera, images))
                if index >= 3:
                    spent[camera].append(took)
        return spent["raster"], spent["vtk"]

    def agreement(self, count: int) -> tuple[float, float, float]:
        """Returns shares of pixels with depth within 1 mm and equal label, and the worst depth."""
        depths, labels = [], []
        for X in self.poses(count, 11):
            self.look(X)
            _, ours, label = self.pull("raster")
            _, theirs, other = self.pull("vtk")
            near = np.isclose(ours, theirs, rtol=0.0, atol=1e-3) | (ours == theirs)
            depths.append(float(near.mean()))
            labels.append(float((label == other).mean()))
        return statistics.mean(depths), statistics.mean(labels), min(depths)


def row(id_: str, what: str, value: float, unit: str, **more: Any) -> None:
    """Prints one line; without a target it is information."""
    target, sense = more.pop("target", None), more.pop("sense", ">=")
    ok = None
    if target is not None:
        ok = value <= target if sense == "<=" else value >= target
    line = {"id": id_, "what": what, "value": round(value, 5), "target": target}
    line["sense"] = sense if target is not None else None
    print(json.dumps({**line, "unit": unit, "ok": ok, **more}), flush=True)


def speed(id_: str, what: str, bench: Bench, images: tuple[str, ...], target: float) -> None:
    """Prints the ratio of CPU times."""
    ours, theirs = bench.times(images, 24)
    ratios = sorted(b / a for a, b in zip(ours, theirs, strict=True))
    row(
        id_,
        what,
        statistics.median(ratios),
        "x",
        target=target,
        p10=round(ratios[len(ratios) // 10], 2),
        ours_ms=round(statistics.median(ours), 2),
        vtk_ms=round(statistics.median(theirs), 2),
        habitat_sim_furnished_ms=8.6,
        habitat_sim_plain_ms=3.1,
    )


def child(world: str, camera: str, frames: int) -> None:
    """Builds a scene, draws, and prints CPU of the first frame and wall time of the others."""
    # What an episode has loaded anyway: its modules, and the planner's compiled loops.
    importlib.import_module("unilavira_drake.episode")
    warm_up()
    start = time.process_time()
    bench = Bench(world, cameras=(camera,))
    poses = list(bench.poses(frames, 3))
    bench.look(poses[0])
    bench.pull(camera)
    first = time.process_time() - start
    start, cpu = time.perf_counter(), time.process_time()
    for X in poses[1:]:
        bench.look(X)
        bench.pull(camera)
    wall, cpu = time.perf_counter() - start, time.process_time() - cpu
    print(json.dumps({"first_s": first, "wall_s": wall, "cpu_s": cpu}))


def children(world: str, task: list[str], processes: int) -> list[dict[str, float]]:
    """Runs children at the same time; each draws in its one thread."""
    command = [sys.executable, __file__, "--world", world, *task]
    running = [
        subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, env={**os.environ, "LP_NUM_THREADS": "0"}
        )
        for _ in range(processes)
    ]
    results: list[dict[str, float]] = [json.loads(p.communicate()[0]) for p in running]
    return results


def building(world: str) -> None:
    """Prints the cost of a new scene, of a view and of a clone, and how processes scale."""
    took: dict[str, list[float]] = {"raster": [], "vtk": []}
    for index in range(BUILDS):
        for camera in ("raster", "vtk") if index % 2 else ("vtk", "raster"):
            took[camera].append(children(world, ["--child", camera, "1"], 1)[0]["first_s"])
    firsts = {camera: statistics.median(seconds) for camera, seconds in took.items()}
    row(
        "R4.build",
        "build + first frame in a process that has loaded an episode: ours / VTK",
        firsts["raster"] / firsts["vtk"],
        "x",
        target=1.0,
        sense="<=",
        **{f"{camera}_s": round(value, 3) for camera, value in firsts.items()},
    )
    Bench(world, cameras=("raster",)).pull("raster")
    memory = []
    benches = [Bench(world, views=views, cameras=("raster",)) for views in (1, 9)]
    for bench in benches:
        before = resident_mb()
        bench.pull("raster")
        memory.append(resident_mb() - before)
    row(
        "R4.memory",
        "memory of each of 8 more views at 640x480, its three images pulled",
        (memory[1] - memory[0]) / 8,
        "MB",
        target=10.0,
        sense="<=",
    )
    task = ["--child", "raster", "150"]
    alone = [children(world, task, 1)[0] for _ in range(2)]
    both = [children(world, task, 2) for _ in range(2)]
    row(
        "R4.scale",
        "frames a second of two processes with one GL thread each, over those of one",
        2.0
        * min(one["wall_s"] for one in alone)
        / min(max(one["wall_s"] for one in pair) for pair in both),
        "x",
        target=1.8,
        cpus=os.cpu_count(),
        cpu_alone_s=round(min(one["cpu_s"] for one in alone), 3),
        cpu_of_each_of_two_s=round(min(one["cpu_s"] for pair in both for one in pair), 3),
        load=round(os.getloadavg()[0], 2),
    )
    clones(world)


def clones(world: str) -> None:
    """Prints what the camera adds to a clone of a Context."""
    bare = Bench(world, cameras=())
    bench = Bench(world, views=4, cameras=("raster",))
    for one in (bare, bench):
        one.look(next(one.poses(1, 3)))
        frame = one.plant.GetBodyFrameIdOrThrow(one.body.index())
        query = one.plant.get_geometry_query_input_port()
        query.Eval(one.plant.GetMyContextFromRoot(one.context)).GetPoseInWorld(frame)
    camera = bench.ports["raster"][0][0]
    camera.frames(camera.GetMyContextFromRoot(bench.context))
    for id_, what in (("clone.frames", "no image port pulled"), ("clone.images", "all pulled")):
        goals = id_ == "clone.frames"
        spent, held = [], []
        for _ in range(40):
            clone = [(*cpu_and_memory(one.context.Clone),) for one in (bare, bench)]
            spent.append(clone[1][0] - clone[0][0])
            held.append(clone[1][1] - clone[0][1])
        row(
            id_,
            f"what a camera of four drawn views adds to a clone of a Context, {what}",
            statistics.median(spent),
            "ms",
            target=1.0 if goals else None,
            sense="<=",
        )
        row(
            f"{id_}.memory",
            "the same in memory",
            statistics.median(held),
            "MB",
            target=1.0 if goals else None,
            sense="<=",
        )
        bench.pull("raster")


def builds(world: str, camera: str, count: int) -> None:
    """Builds a scene again and again, and prints what each build leaves behind, megabytes."""
    for number in (10, count):
        before = resident_mb()
        for _ in range(number):
            Bench(world, (320, 240), cameras=(camera,)).pull(camera)
    print(json.dumps({"mb": (resident_mb() - before) / count}))


def leaks(world: str) -> None:
    """Prints what 10,000 frames and 200 builds leave behind."""
    bench = Bench(world, (320, 240), cameras=("raster",))
    poses = list(bench.poses(100, 5))
    # What is made once, such as a shader for a kind of picture, is made in the first round.
    for rounds in (1, 100):
        before = resident_mb()
        for X in poses * rounds:
            bench.look(X)
            bench.pull("raster")
    row("leak.frames", "memory after 10,000 frames more", resident_mb() - before, "MB")
    each = {
        camera: children(world, ["--builds", camera, "200"], 1)[0]["mb"]
        for camera in ("none", "bystander", "raster")
    }
    row(
        "leak.builds",
        "memory of each of 200 builds more, beyond that of a diagram with an empty Python System",
        each["raster"] - each["bystander"],
        "MB",
        **{f"{camera}_mb": round(value, 3) for camera, value in each.items()},
    )


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--world", default="apartment", help="furnished world")
    parser.add_argument("--poses", type=int, default=200, help="poses to compare pictures at")
    parser.add_argument("--leaks", action="store_true", help="10,000 frames and 200 builds, too")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--builds", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    world = arguments.world
    if arguments.child:
        child(world, arguments.child[0], int(arguments.child[1]))
        return
    if arguments.builds:
        builds(world, arguments.builds[0], int(arguments.builds[1]))
        return
    with tempfile.TemporaryDirectory() as folder:
        room = Path(folder) / "room.yaml"
        room.write_text(ROOM, encoding="utf-8")
        furnished, plain = Bench(world), Bench(str(room))
        speed("R1", f"colour, depth and label of {world}, 640x480", furnished, IMAGES, 6.0)
        speed("R2.room", "colour, depth and label of a plain textured room", plain, IMAGES, 6.0)
        panorama = Bench(world, views=4)
        speed("R2.panorama", f"four views all around in {world}", panorama, IMAGES, 6.0)
        small = Bench(world, (320, 240))
        speed("R3", f"depth alone of {world}, 320x240", small, DEPTH, 3.0)
        for name, bench in ((world, furnished), ("room", plain), ("shapes", Bench(""))):
            depth, label, worst = bench.agreement(arguments.poses)
            row(f"agree.depth.{name}", "pixels within 1 mm of VTK's", depth, "1", target=0.995,
                worst_picture=round(worst, 5), poses=arguments.poses)  # fmt: skip
            row(f"agree.label.{name}", "pixels with VTK's label", label, "1", target=0.997)
    building(world)
    if arguments.leaks:
        leaks(world)


if __name__ == "__main__":
    main()
