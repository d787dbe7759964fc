"""A robot at work as a page that anyone can open: an episode, played back in Meshcat."""

from __future__ import annotations

import base64
import gzip
import html
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, MeshcatVisualizer, Rgba, Sphere
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator, SimulatorStatus
from pydrake.systems.framework import DiagramBuilder
from robot_stage import Point, add_blocks, add_robot, dolls_house

from unilavira_drake import make_navigation_diagram
from unilavira_drake.scenario import Scenario
from unilavira_drake.task_choice import choose_task
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import add_scenery
from unilavira_drake.worlds.world import World

RATE, RATE_OUTDOORS = 12.0, 5.0
"""Pictures a simulated second; legs swing faster than an aircraft flies far."""
MARK = 3.0
"""Radius of the ball around what flies in a town, which is too small to be seen, metres."""
WALLS = 0.6
"""Height of what is left of the walls, metres."""
CAPTION = (
    "position:fixed;left:0;bottom:0;margin:14px;padding:8px 12px;max-width:60em;"
    "font:15px/1.4 sans-serif;color:#222;background:#fffc;border-radius:4px"
)
# A viewer alone has two megabytes, a fifth of which is left when packed.
PAGE = """<!DOCTYPE html>
<html><head><meta charset="utf-8"><title>{title}</title></head>
<body>Unpacking; this takes a browser of 2023 or later.
<script>
const packed = Uint8Array.from(atob("{packed}"), letter => letter.charCodeAt(0));
const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
new Response(stream).text().then(page => {{
  document.open(); document.write(page); document.close();
}});
</script></body></html>
"""


def record(scenario: Scenario, *, title: str, eye: Point, target: Point) -> str:
    """Runs a scenario's task with its agent and returns a page that shows the robot's motion.

    It is seen from ``eye`` to ``target``, until a person turns it.

    Raises:
        RuntimeError: if the episode did not end by the agent's own stop.
    """
    world = load_world(scenario.world.name)
    rate = RATE_OUTDOORS if world.outdoors else RATE
    motion, way = _motion(scenario, rate)
    meshcat = _play(scenario.robot.name, world, motion, rate)
    _set_the_scene(meshcat, way, width=0.8 if world.outdoors else 0.05)
    if world.outdoors:
        # Before its pose, which it would forget.
        meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=55.0, near=0.5, far=2000.0))
    meshcat.SetCameraPose(eye, target)
    if world.outdoors:
        path = f"/drake/visualizer/{scenario.robot.name}/base/mark"
        meshcat.SetObject(path, Sphere(MARK), Rgba(0.9, 0.35, 0.1, 0.35))
    caption = f"{title}: {html.escape(choose_task(scenario).spec.text)}"
    page = meshcat.StaticHtml().replace("</body>", f'<div style="{CAPTION}">{caption}</div></body>')
    packed = gzip.compress(page.encode(), mtime=0)
    return PAGE.format(title=title, packed=base64.b64encode(packed).decode())


def _motion(scenario: Scenario, rate: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Returns positions of the joints, one row a picture, and where the robot was, (k, 3)."""
    diagram = make_navigation_diagram(scenario)
    simulator = Simulator(diagram)
    station = diagram.GetSubsystemByName("station")
    root = simulator.get_context()
    context = station.GetMyContextFromRoot(root)
    plant: Any = station.GetSubsystemByName("plant")
    ended = SimulatorStatus.ReturnReason.kReachedTerminationCondition
    motion, way, over = [], [], False
    while not over:
        # Copies: what is returned are views.
        motion.append(np.array(plant.GetPositions(plant.GetMyContextFromRoot(root))))
        way.append(np.array(station.GetOutputPort("cheat_X_WB").Eval(context).translation()))
        over = simulator.AdvanceTo(len(motion) / rate).reason() == ended
    monitor = diagram.GetSubsystemByName("episode_monitor")
    port = monitor.GetOutputPort("metrics")
    metrics: Any = port.Eval(monitor.GetMyContextFromRoot(root))
    if metrics.cause != "stopped":
        raise RuntimeError(f"{scenario.robot.name}: the episode ended with {metrics.cause!r}")
    return np.array(motion), np.array(way)


def _play(robot: str, world: World, motion: NDArray[np.float64], rate: float) -> Meshcat:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    if world.outdoors:
        add_blocks(plant, world)
    else:
        add_scenery(plant, scene_graph, dolls_house(world, WALLS))
    add_robot(plant, robot, seen=False)
    plant.Finalize()
    meshcat = Meshcat()
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    meshcat.StartRecording(frames_per_second=rate, set_visualizations_while_recording=False)
    for index, positions in enumerate(motion):
        context.SetTime(index / rate)
        plant.SetPositions(plant.GetMyMutableContextFromRoot(context), positions)
        diagram.ForcedPublish(context)
    meshcat.StopRecording()
    meshcat.PublishRecording()
    return meshcat


def _set_the_scene(meshcat: Meshcat, way: NDArray[np.float64], *, width: float) -> None:
    for path in ("/Grid", "/Axes", "/Lights/PointLightNegativeX", "/Lights/PointLightPositiveX"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetProperty("/Background", "top_color", [0.80, 0.87, 0.95])
    meshcat.SetProperty("/Background", "bottom_color", [0.95, 0.96, 0.97])
    # The lamps that are there light a table; a flat wants a sun.
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 1.3)
    meshcat.SetProperty("/Lights/FillLight/<object>", "intensity", 2.2)
    meshcat.SetProperty("/Lights/FillLight/<object>", "position", [-5.0, -12.0, 9.0])
    vertices, faces = ribbon(way, width)
    meshcat.SetTriangleMesh("/way", vertices, faces, Rgba(0.9, 0.35, 0.1, 1.0))


def ribbon(way: NDArray[np.float64], width: float) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Returns a band along a way as a mesh: vertices (3, 2k), faces (3, 2k - 2)."""
    moved = np.r_[True, np.linalg.norm(np.diff(way, axis=0), axis=1) > 0.01]
    points = way[moved] + (0.0, 0.0, 0.02)
    along = np.gradient(points[:, :2], axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.c_[-along[:, 1], along[:, 0], np.zeros(len(points))] * width / 2.0
    vertices = np.stack([points - across, points + across], axis=1).reshape(-1, 3)
    first = 2 * np.arange(len(points) - 1)[:, None]
    faces = (first[:, :, None] + np.array([[0, 2, 1], [1, 2, 3]])).reshape(-1, 3)
    return vertices.T, faces.T.astype(np.int32)
