"""Draws the pictures of the README: a contact sheet of views, and a run as an animation.

python docs/make_pictures.py views     # docs/views.jpg
python docs/make_pictures.py run       # docs/run.gif
python docs/make_pictures.py town      # docs/town.jpg
"""

from __future__ import annotations

import argparse
import math
import textwrap
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from pydrake.geometry import ClippingRange, DepthRange, RenderCameraCore
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo

from unilavira_drake import load_scenario, make_navigation_diagram
from unilavira_drake.messages import LanguageAction, Panorama, TodoList, VisionAction
from unilavira_drake.raster import RasterCameraConfig, RasterView, add_raster_camera, suns_of
from unilavira_drake.recording.message_log import MessageLog
from unilavira_drake.station import make_navigation_station
from unilavira_drake.worlds.clearance import clearance, room_grid
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.scenery import add_scenery, lights
from unilavira_drake.worlds.world import Room, World

FOLDER = Path(__file__).parent
FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
WORLDS = ("apartment", "office")
COLUMNS, TILE = 6, (320, 240)
ROOM_TO_STAND = 0.4
"""Clearance of a viewpoint, metres."""
STEP = 0.9
"""Simulated seconds between two pictures of the animation."""
SIZE = (760, 330)
INK, PALE, DONE = (30, 30, 30), (110, 110, 110), (20, 130, 60)


def font(size: int, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Returns the font that comes with matplotlib."""
    return ImageFont.truetype(str(FONTS / f"DejaVuSans{'-Bold' if bold else ''}.ttf"), size)


def viewpoints(world: World) -> list[tuple[Room, float, float, float]]:
    """Returns where to stand in each room and where to look: from a corner to the middle.

    The largest rooms get a second view, so that a world has twelve.
    """
    found = []
    for room in world.rooms:
        points = room_grid(room, 0.1)
        points = points[clearance(world, points) >= ROOM_TO_STAND]
        middle = np.array(room.center)
        first = points[np.argmax(np.hypot(*(points - middle).T))]
        second = points[np.argmax(np.hypot(*(points - first).T))]
        for rank, (x, y) in enumerate((first, second)):
            yaw = math.atan2(middle[1] - y, middle[0] - x)
            found.append((rank, -len(points), room, x, y, yaw))
    found.sort(key=lambda view: view[:2])
    return [(room, x, y, yaw) for _, _, room, x, y, yaw in found[:12]]


def views() -> Image.Image:
    """Returns twelve views of each furnished world, as the robot's camera sees them."""
    tiles: list[NDArray[np.uint8]] = []
    for name in WORLDS:
        world = load_world(name)
        station = make_navigation_station(load_scenario(name), world=world)
        context = station.CreateDefaultContext()
        plant: Any = station.GetSubsystemByName("plant")
        plant_context = plant.GetMyMutableContextFromRoot(context)
        for _, x, y, yaw in viewpoints(world):
            plant.SetPositions(plant_context, [x, y, yaw])
            image: Any = station.GetOutputPort("front.color_image").Eval(context)
            tiles.append(np.array(image.data[:, :, :3]))
    rows = -(-len(tiles) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * TILE[0], rows * TILE[1]), "white")
    for index, tile in enumerate(tiles):
        place = (index % COLUMNS * TILE[0], index // COLUMNS * TILE[1])
        sheet.paste(Image.fromarray(tile).resize(TILE, Image.Resampling.LANCZOS), place)
    return sheet


TOWN_VIEWS = (
    # x, y, z (metres), yaw and pitch (degrees, down is positive), width and height (pixels).
    ((218.0, -20.0, 150.0, 90.0, 38.0), (1280, 620)),
    ((150.0, 30.0, 40.0, 90.0, 26.0), (640, 400)),
    ((240.0, 118.0, 9.0, 8.0, 8.0), (640, 400)),
    ((46.0, 60.0, 25.0, 90.0, 24.0), (640, 400)),
    ((300.0, 201.0, 5.0, 180.0, 3.0), (640, 400)),
)


def town() -> Image.Image:
    """Returns the town from high above and, below, from where aircraft fly."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
    add_scenery(plant, scene_graph, load_world("town"))
    plant.Finalize()
    cameras: list[Any] = []
    for index, (place, (width, height)) in enumerate(TOWN_VIEWS):
        focal = 0.56 * width
        core = RenderCameraCore(
            "raster",
            CameraInfo(2 * width, 2 * height, 2 * focal, 2 * focal, width, height),
            ClippingRange(0.1, 900.0),
            RigidTransform(),
        )
        view = RasterView(
            scene_graph.world_frame_id(), looking(*place), core, DepthRange(0.1, 800.0)
        )
        config = RasterCameraConfig((view,), light=suns_of(lights()))
        cameras.append(add_raster_camera(builder, scene_graph, config, f"camera_{index}"))
    context = builder.Build().CreateDefaultContext()
    sheet = Image.new("RGB", (1280, 620 + 2 * 400), "white")
    for index, (camera, (_, size)) in enumerate(zip(cameras, TOWN_VIEWS, strict=True)):
        frame = camera.frames(camera.GetMyContextFromRoot(context))[0]
        tile = Image.fromarray(np.array(frame.color[:, :, :3]))
        row, column = divmod(index - 1, 2)
        place = (640 * column, 620 + 400 * row) if index else (0, 0)
        sheet.paste(tile.resize(size, Image.Resampling.LANCZOS), place)
    return sheet


def looking(x: float, y: float, z: float, yaw: float, pitch: float) -> RigidTransform:
    """Returns a camera's pose in the world (x right, y down, z forward); degrees."""
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    level, down = math.cos(math.radians(pitch)), math.sin(math.radians(pitch))
    ahead, right = np.array([c * level, s * level, -down]), np.array([s, -c, 0.0])
    axes: Any = np.stack((right, np.cross(ahead, right), ahead), axis=1)
    p_WC: Any = np.array([x, y, z])
    return RigidTransform(RotationMatrix(axes), p_WC)


class Story:
    """What the agent last said, beside what its camera sees."""

    def __init__(self, task: str) -> None:
        self._task = task
        self._todo = TodoList()
        self._action = LanguageAction()
        self._target = ""
        self.ahead: NDArray[np.uint8] | None = None
        """The front view of the latest panorama."""

    def listen(self, t: float, system: str, event: str, message: Any) -> None:
        """Takes a message of the ring."""
        if isinstance(message, TodoList):
            self._todo = message
        elif isinstance(message, LanguageAction):
            self._action, self._target = message, ""
        elif isinstance(message, VisionAction):
            self._target = message.target_desc
        elif isinstance(message, Panorama):
            self.ahead = message.frame("front").color

    def picture(self, camera: NDArray[np.uint8], time: float) -> Image.Image:
        """Returns one picture of the animation."""
        image = Image.new("RGB", SIZE, "white")
        image.paste(Image.fromarray(camera).resize((440, 330), Image.Resampling.LANCZOS))
        draw = ImageDraw.Draw(image)
        y = 10
        for line in textwrap.wrap(self._task, 44):
            draw.text((452, y), line, INK, font(12, bold=True))
            y += 16
        y += 8
        for item in self._todo.items:
            done = item.status == "completed"
            mark = "☑" if done else "☐"
            for index, line in enumerate(textwrap.wrap(item.content, 40)):
                draw.text(
                    (452, y),
                    f"{mark if index == 0 else ' '} {line}",
                    DONE if done else INK,
                    font(12),
                )
                y += 16
        tool = f"{self._action.n}. {self._action.tool} {self._action.argument}".strip()
        draw.text(
            (452, 282), tool if self._action.n else "looking around", INK, font(13, bold=True)
        )
        draw.text((452, 300), self._target[:44], PALE, font(12))
        draw.text((690, 310), f"{time:5.1f} s", PALE, font(11))
        return image


def animation(scenario_name: str, task: str) -> list[Image.Image]:
    """Returns the pictures of a run, one each ``STEP`` of simulated time."""
    scenario = load_scenario(scenario_name, f"task: {{text: '@{task}'}}")
    story = Story(" ".join(scenario.tasks[task].text.split()))
    diagram = make_navigation_diagram(scenario, on_message=MessageLog([story.listen]))
    simulator = Simulator(diagram)
    station = diagram.GetSubsystemByName("station")
    pictures = []
    reached = False
    while not reached:
        time = simulator.get_context().get_time()
        status: Any = simulator.AdvanceTo(time + STEP)
        reached = status.reason() == status.ReturnReason.kReachedTerminationCondition
        context = station.GetMyContextFromRoot(simulator.get_context())
        image: Any = station.GetOutputPort("front.color_image").Eval(context)
        pictures.append(story.picture(np.array(image.data[:, :, :3]), time + STEP))
    # Its last look around ends at another side than that on which it arrived.
    end = simulator.get_context().get_time()
    assert story.ahead is not None
    return pictures + [story.picture(story.ahead, end)] * 7


def main() -> None:
    """Draws what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("views", "run", "town"))
    parser.add_argument("--scenario", default="apartment")
    parser.add_argument("--task", default="fridge")
    options = parser.parse_args()
    if options.what == "views":
        views().save(FOLDER / "views.jpg", quality=82)
        return
    if options.what == "town":
        town().save(FOLDER / "town.jpg", quality=74, optimize=True)
        return
    pictures = animation(options.scenario, options.task)
    small = [picture.quantize(128, dither=Image.Dither.NONE) for picture in pictures]
    small[0].save(FOLDER / "run.gif", save_all=True, append_images=small[1:], duration=280, loop=0)


if __name__ == "__main__":
    main()
