"""Draws the robots: a portrait of each, all side by side, and a recording of each at work.

python docs/make_robot_pictures.py portraits                # docs/robots/NAME.jpg
python docs/make_robot_pictures.py sheet                    # docs/robots.jpg
python docs/make_robot_pictures.py recordings               # docs/robots/NAME.html
python docs/make_robot_pictures.py portraits --robot unitree_go1 --size 320x180 --out /tmp
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from pydrake.systems.analysis import Simulator
from robot_recording import record
from robot_stage import Point, Stage, look_at, studio

from unilavira_drake import load_scenario
from unilavira_drake.scenario import Scenario
from unilavira_drake.scenario_loading import robot_setting
from unilavira_drake.station import make_navigation_station
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.world import World

FOLDER = Path(__file__).parent
FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
SIZE = (960, 540)
SPACING = 1.6
"""Between two robots on the sheet, metres."""
COLUMN = 320
"""Width of a robot's part of the sheet, pixels."""
INK, PALE = (30, 30, 30), (110, 110, 110)
VANTAGE = (4.3, 3.5, -2.6)
"""Where all robots stand in the apartment for the views of the sheet: x, y, yaw."""


@dataclass(frozen=True)
class Entry:
    """How a robot is shown.

    ``speed`` and ``seconds`` say what it does until its picture is taken, from ``start`` at
    ``height``; ``task`` is what it is recorded at.
    """

    title: str
    speed: float
    seconds: float
    start: tuple[float, float, float]
    eye: Point
    target: Point
    fov_degrees: float
    height: float = 0.0
    scenario: str = "flat"
    task: str = "couch"
    recorded_from: tuple[Point, Point] = ((6.5, -1.0, 9.4), (6.5, 4.5, 0.0))


ENTRIES = {
    "cobot_magic": Entry(
        title="CobotMagic",
        speed=0.4,
        seconds=0.5,
        start=(3.0, 3.4, -1.5),
        eye=(4.2, 0.75, 1.2),
        target=(2.75, 3.2, 0.65),
        fov_degrees=60.0,
    ),
    "unitree_go1": Entry(
        title="UnitreeGo1",
        speed=0.6,
        seconds=1.45,
        start=(13.75, 8.4, -2.65),
        eye=(12.1, 7.0, 0.55),
        target=(13.3, 8.2, 0.27),
        fov_degrees=62.0,
    ),
    "unitree_g1": Entry(
        title="UnitreeG1",
        speed=0.4,
        seconds=2.3,
        start=(2.5, 8.75, -0.95),
        eye=(4.6, 6.85, 1.3),
        target=(2.55, 8.0, 0.60),
        fov_degrees=66.0,
    ),
    "quadrotor": Entry(
        title="Quadrotor",
        speed=1.0,
        seconds=0.5,
        start=(2.9, 3.0, -1.0),
        eye=(3.75, 1.7, 1.6),
        target=(2.75, 3.1, 1.05),
        fov_degrees=56.0,
        height=1.25,
        scenario="town",
        task="easy_market_fountain",
        recorded_from=((150.0, -20.0, 110.0), (222.0, 95.0, 0.0)),
    ),
}


def scenario_of(name: str, file: str = "apartment", task: str = "") -> Scenario:
    """Returns a scenario with another robot in it."""
    overlay = f"{{robot: {robot_setting(name)}, task: {{text: '{'@' * bool(task)}{task}'}}}}"
    return load_scenario(file, overlay=overlay)


def posture(name: str, world: World, start: tuple[float, float, float]) -> NDArray[np.float64]:
    """Returns the positions of a robot's joints in the middle of its motion."""
    entry, scenario, (x, y, yaw) = ENTRIES[name], scenario_of(name), start
    station = make_navigation_station(scenario, world=world, start=start, start_height=entry.height)
    simulator = Simulator(station)
    command = [entry.speed, 0.0, 0.0]
    if entry.height:
        ahead = (x + entry.speed * math.cos(yaw), y + entry.speed * math.sin(yaw), entry.height)
        command = [*ahead, yaw, 0.0, 0.0, 0.0]
    station.GetInputPort("base_command").FixValue(simulator.get_mutable_context(), command)
    simulator.AdvanceTo(entry.seconds)
    plant: Any = station.GetSubsystemByName("plant")
    return np.array(plant.GetPositions(plant.GetMyContextFromRoot(simulator.get_context())))


def portrait(name: str, size: tuple[int, int]) -> Image.Image:
    """Returns a robot in the apartment, as a bystander sees it."""
    entry, world = ENTRIES[name], load_world("apartment")
    stage = Stage(world, [name], shadows=min(4096, 4 * size[0]))
    stage.place({name: posture(name, world, entry.start)})
    camera = look_at(entry.eye, entry.target)
    return stage.picture(camera, size, fov_degrees=entry.fov_degrees)


def views(name: str) -> dict[str, Image.Image]:
    """Returns what a robot's cameras see from the vantage point; one alone is turned."""
    scenario, (x, y, yaw) = scenario_of(name), VANTAGE
    world, seen = load_world("apartment"), {}
    around = dict.fromkeys(scenario.robot.views, 0.0)
    if len(around) == 1:
        around = {"front": 0.0, "left": 0.5, "back": 1.0, "right": -0.5}
    for view, half_turns in around.items():
        start = (x, y, yaw + math.pi * half_turns)
        station = make_navigation_station(
            scenario, world=world, start=start, start_height=ENTRIES[name].height
        )
        camera = view if view in scenario.robot.views else "front"
        port = station.GetOutputPort(f"{camera}.color_image")
        image: Any = port.Eval(station.CreateDefaultContext())
        seen[view] = Image.fromarray(np.array(image.data[:, :, :3]))
    return seen


def font(size: int, *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Returns the font that comes with matplotlib."""
    return ImageFont.truetype(str(FONTS / f"DejaVuSans{'-Bold' if bold else ''}.ttf"), size)


def line_up(names: Sequence[str]) -> Image.Image:
    """Returns the robots side by side, at one scale: ``COLUMN`` pixels are ``SPACING`` metres."""
    stage = Stage(studio(), names, shadows=8192)
    middle, yaw, places = (len(names) - 1) / 2.0, -math.pi / 2 + 0.45, {}
    for index, name in enumerate(names):
        entry = ENTRIES[name]
        # On the way for so long that it comes to stand on its line.
        before = 0.0 if entry.height else entry.speed * entry.seconds
        x, y = SPACING * (index - middle) - before * math.cos(yaw), -before * math.sin(yaw)
        places[name] = posture(name, studio(), (x, y, yaw))
    stage.place(places)
    width, far = COLUMN * len(names), 40.0
    fov = 2.0 * math.degrees(math.atan(SPACING * len(names) / 2.0 / far))
    height = 0.72
    camera = look_at((0.0, -far * math.cos(0.16), height + far * math.sin(0.16)), (0, 0, height))
    return stage.picture(camera, (width, 360), fov_degrees=fov, nearest=20.0)


def sheet(names: Sequence[str]) -> Image.Image:
    """Returns all robots, and below each what its cameras see from the same place."""
    top, front, caption = 360, COLUMN * 3 // 4, 22
    small = (COLUMN - 8) // 3
    width, height = COLUMN * len(names), top + caption + front + caption + small * 3 // 4 + 10
    image = Image.new("RGB", (width, height), "white")
    image.paste(line_up(names))
    draw = ImageDraw.Draw(image)
    metre = COLUMN / SPACING
    draw.line((12, top - 12, 12 + metre, top - 12), INK, 2)
    draw.text((12, top - 17), "1 m", INK, font(13), anchor="ls")
    for index, name in enumerate(names):
        left = COLUMN * index
        draw.text((left + COLUMN / 2, 12), ENTRIES[name].title, INK, font(16, bold=True), "mt")
        seen = views(name)
        turned = "" if len(scenario_of(name).robot.views) > 1 else " (one camera, which turns)"
        y = top + caption
        draw.text((left + 4, y - 6), f"front{turned}", PALE, font(12), "ls")
        image.paste(_fitted(seen.pop("front"), (COLUMN - 6, front)), (left + 3, y))
        y += front + caption
        side = (COLUMN - 6 - 4 * (len(seen) - 1)) // len(seen)
        for place, (view, picture) in enumerate(seen.items()):
            x = left + 3 + place * (side + 4)
            draw.text((x + 1, y - 6), view, PALE, font(12), "ls")
            image.paste(_fitted(picture, (side, small * 3 // 4)), (x, y))
    return image


def _fitted(image: Image.Image, size: tuple[int, int]) -> Image.Image:
    """Returns the middle of an image, filling a size."""
    scale = max(size[0] / image.width, size[1] / image.height)
    resized = image.resize(
        (math.ceil(scale * image.width), math.ceil(scale * image.height)), Image.Resampling.LANCZOS
    )
    left, top = (resized.width - size[0]) // 2, (resized.height - size[1]) // 2
    return resized.crop((left, top, left + size[0], top + size[1]))


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)x(\d+)", text)
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT")
    return int(found[1]), int(found[2])


def main(arguments: Sequence[str] | None = None) -> None:
    """Draws what is asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("portraits", "sheet", "recordings"))
    parser.add_argument("--robot", choices=ENTRIES, action="append", help="repeat; default: all")
    parser.add_argument("--size", type=_size, default=SIZE, help="of a portrait, WIDTHxHEIGHT")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder; default: docs")
    options = parser.parse_args(arguments)
    names = options.robot or list(ENTRIES)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.what == "sheet":
        sheet(names).save(options.out / "robots.jpg", quality=85)
        return
    folder = options.out / "robots"
    folder.mkdir(exist_ok=True)
    for name in names:
        entry = ENTRIES[name]
        if options.what == "portraits":
            portrait(name, options.size).save(folder / f"{name}.jpg", quality=85)
        else:
            eye, target = entry.recorded_from
            scenario = scenario_of(name, entry.scenario, entry.task)
            page = record(scenario, title=entry.title, eye=eye, target=target)
            (folder / f"{name}.html").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
