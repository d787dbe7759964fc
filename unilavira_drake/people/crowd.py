"""Who walks where: drawn from a seed, on the free floor of a world."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.errors import ScenarioError, unknown_name
from unilavira_drake.messages import Message
from unilavira_drake.people.config import PeopleConfig, WalkRoute
from unilavira_drake.planning.geodesic import FreeSpace, GeodesicField, rasterize
from unilavira_drake.worlds.clearance import clearance, obstacles, room_grid
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.world import LabelEntry, Room, World

GROUND = 0.0
"""Height of the floor of the storey on which all people walk, metres."""
RADIUS = 0.25
"""Of a person with arms, metres."""
CLEARANCE = 0.33
"""What a walk keeps between a person's middle and walls and things, metres."""
START_DISTANCE = 1.5
"""Nobody who is drawn begins nearer to the robot, metres."""
SHORTEST_WALK = 3.0
"""Of walks that are drawn, metres."""
CLOTHES = ("blue", "red", "green", "orange", "purple", "yellow", "pink", "cyan")

_TRIES = 200
_GRID_STEP = 0.2

Point = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Person(Message):
    """One person: how they look, and their walk."""

    name: str = ""
    label: int = 0
    """Render label."""
    color: str = ""
    """Colour word of the clothes."""
    height: float = 1.75
    """Metres."""
    walk: tuple[Point, ...] = ()
    """Points in the world, metres; walked to the last and back again."""
    speed: float = 1.0
    """Metres a second."""
    pauses: tuple[float, ...] = ()
    """Rests at the ends in turn, seconds; they begin again when they are used up."""
    delay: float = 0.0
    """Seconds before the first step."""
    look: int = 0
    """Chooses hair, skin and trousers."""


def person_names(config: PeopleConfig) -> tuple[str, ...]:
    """Returns the instance names of the people, ``person_1`` and so on."""
    return tuple(f"person_{k}" for k in range(1, config.count + 1))


def detected_labels(world: World, config: PeopleConfig) -> tuple[int, ...]:
    """Returns the labels of people that the mapper is told of."""
    names = person_names(config) if config.detected else ()
    labels = (world.label_of(name) for name in names)
    return tuple(label for label in labels if label is not None)


def with_people(world: World, config: PeopleConfig) -> World:
    """Returns the world with the labels of its people; the same world where there are none
    or it has them.
    """
    if config.count == 0 or world.label_of(person_names(config)[0]) is not None:
        return world
    first = max(world.labels) + 1
    labels = {first + k: LabelEntry("person", name) for k, name in enumerate(person_names(config))}
    return dataclasses.replace(world, labels=world.labels | labels)


def make_crowd(
    config: PeopleConfig, world: World, *, seed: int, robot: Point
) -> tuple[Person, ...]:
    """Returns the people of a scenario.

    Args:
        config: how many, and what is known of their walks.
        world: where they walk, with their labels (``with_people``).
        seed: of the scenario; that of ``config`` comes first.
        robot: where the robot starts, metres.

    Raises:
        ScenarioError: names the place, the value and the remedy, where a walk cannot be walked.
    """
    if config.count == 0:
        return ()
    if len(config.routes) > config.count:
        raise ScenarioError(
            f"people.routes: {len(config.routes)} walks for {config.count} people; "
            f"give people.count: {len(config.routes)}."
        )
    random = np.random.default_rng((seed if config.seed is None else config.seed, 4021))
    floor = _Floor(world)
    order = random.permutation(len(CLOTHES))
    people: list[Person] = []
    for k, name in enumerate(person_names(config)):
        route = config.routes[k] if k < len(config.routes) else WalkRoute()
        walk = (
            floor.named(route.waypoints, f"people.routes.{k}.waypoints")
            if k < len(config.routes)
            else floor.drawn(random, [robot, *(person.walk[0] for person in people)])
        )
        people.append(_person(name, world, walk, route, config, random, int(order[k % len(order)])))
    return tuple(people)


def _person(
    name: str,
    world: World,
    walk: tuple[Point, ...],
    route: WalkRoute,
    config: PeopleConfig,
    random: np.random.Generator,
    color: int,
) -> Person:
    if route.color and route.color not in PALETTE:
        raise ScenarioError(unknown_name("color", route.color, PALETTE, f"people: {name}"))
    label = world.label_of(name)
    assert label is not None
    # Always drawn, so that a given number leaves all others as they are.
    speed = float(random.uniform(config.min_speed, config.max_speed))
    pauses = random.uniform(config.min_pause, config.max_pause, 16).tolist()
    height = float(random.uniform(1.60, 1.86))
    look = int(random.integers(1000))
    return Person(
        name=name,
        label=label,
        color=route.color or CLOTHES[color],
        height=round(height, 3),
        walk=walk,
        speed=speed if route.speed is None else route.speed,
        pauses=tuple(pauses) if route.pause is None else (route.pause,),
        delay=route.delay,
        look=look,
    )


class _Floor:
    """The floor on which people can walk, and ways over it."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._rooms = tuple(room for room in world.rooms if room.elevation == GROUND)
        x_min, y_min = (min(room.rectangle[i] for room in world.rooms) for i in (0, 1))
        x_max, y_max = (max(room.rectangle[i] for room in world.rooms) for i in (2, 3))
        self._space: FreeSpace = rasterize(
            [box.corners() for _, box in obstacles(world)],
            bounds=(x_min, y_min, x_max, y_max),
            resolution=0.05,
            inflation=CLEARANCE,
        )

    def named(self, waypoints: Sequence[str], place: str) -> tuple[Point, ...]:
        """Returns the walk along waypoints that a scenario names."""
        if len(waypoints) < 2:
            raise ScenarioError(f"{place}: {list(waypoints)}; name two waypoints or more.")
        points = [self._point(text, place) for text in waypoints]
        walk: list[Point] = points[:1]
        for text, start, end in zip(waypoints[1:], points, points[1:], strict=False):
            way = self._way(start, end)
            if way is None:
                raise ScenarioError(
                    f"{place}: {text!r} cannot be reached on foot from the waypoint before; "
                    "move it to free floor."
                )
            walk += way[1:]
        return tuple(walk)

    def drawn(self, random: np.random.Generator, others: Sequence[Point]) -> tuple[Point, ...]:
        """Returns a walk between two places that are drawn, in two rooms where there are two."""
        rooms = [room for room in self._rooms if len(self._free(room))]
        for _ in range(_TRIES if rooms else 0):
            chosen = random.choice(len(rooms), size=2, replace=len(rooms) < 2)
            start, end = (self._draw(random, rooms[int(k)]) for k in chosen)
            if any(math.dist(start, other) < START_DISTANCE for other in others):
                continue
            way = self._way(start, end)
            if way is not None and math.dist(start, end) >= SHORTEST_WALK:
                return way
        raise ScenarioError(
            f"people.count: the world {self._world.name!r} has no room for so many; lower it, or "
            "name people.routes."
        )

    def _free(self, room: Room) -> NDArray[np.float64]:
        points = room_grid(room, _GRID_STEP)
        return points[[self._space.is_free(x, y) for x, y in points.tolist()]]

    def _draw(self, random: np.random.Generator, room: Room) -> Point:
        points = self._free(room)
        x, y = points[int(random.integers(len(points)))].tolist()
        return x, y

    def _point(self, text: str, place: str) -> Point:
        if "," in text:
            try:
                x, y = (float(part) for part in text.split(","))
            except ValueError:
                raise ScenarioError(f"{place}: {text!r} is not X,Y or a room.") from None
            y = -y if self._world.mirrored else y
        else:
            room = self._world.room(text) or self._world.room(text.replace("_", " "))
            if room is None:
                names = {room.name for room in self._rooms}
                raise ScenarioError(unknown_name("room", text, names, place))
            if room.elevation != GROUND:
                known = ", ".join(room.name for room in self._rooms)
                raise ScenarioError(
                    f"{place}: {text!r} has its floor at {room.elevation:g} m; people walk at "
                    f"{GROUND:g} m alone: name one of {known}."
                )
            points = room_grid(room, _GRID_STEP)
            x, y = points[int(np.argmax(clearance(self._world, points)))].tolist()
        if not self._space.is_free(x, y):
            raise ScenarioError(
                f"{place}: {text!r} is not free floor; keep {CLEARANCE} m from walls and things."
            )
        return x, y

    def _way(self, start: Point, end: Point) -> tuple[Point, ...] | None:
        u, v = self._space.point(*end)
        goal = np.array([[math.floor(v), math.floor(u)]])
        path = GeodesicField.to_cells(self._space, goal).path(*start)
        if len(path) == 0:
            return None
        return (start, *((float(x), float(y)) for x, y in path[1:-1]), end)
