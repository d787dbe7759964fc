"""Everything one decision in flight is made from: legs, scene, and what was tried."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from unilavira_drake.messages import DOWN, ON_THE_WAY, TodoItem
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest, WaypointNote
from unilavira_drake.mllm.rules.flight.legs import Leg
from unilavira_drake.mllm.rules.flight.parser import parse_directive, plan_legs
from unilavira_drake.mllm.rules.flight.scene import AirScene, LandmarkSight, look_around
from unilavira_drake.stated_direction import stated_direction

REACH = 8.0
"""A landmark below or beside is reached from this height over it, metres."""
FAR_REACH = 14.0
"""The same where it cannot be come nearer, metres."""
FAILED = 60.0
"""What a failed move in a direction counts, metres."""
BESIDE_REACH = 9.0
"""One that stands as high as the aircraft: along the ground, metres."""
PASSING = 25.0
"""One that is only passed: along the ground, metres."""
LEVEL = 2.5
"""A height is reached within this, metres."""
DOUBT = 40.0
"""So far from a stated place its thing may stand, metres ..."""
_DOUBT_SHARE = 0.3
"""... and this share of the stated distance farther."""

MEASURED = 30.0
"""Higher up the depth camera may not see the ground, metres."""
_HEIGHT = re.compile(r"^Above the .* at (\d+) m")


@dataclass(frozen=True)
class FlightStep:
    """One item of the plan; ``index`` counts from 1 in the list as shown."""

    index: int
    leg: Leg
    done: bool = False


@dataclass(frozen=True)
class FlightSituation:
    """What the reasoner knows at one call."""

    variables: LanguageVariables
    scene: AirScene
    steps: tuple[FlightStep, ...]

    @property
    def here(self) -> WaypointNote | None:
        """The present waypoint."""
        current = self.variables.current_waypoint
        return next((w for w in self.variables.waypoints if w.id == current), None)

    @property
    def start(self) -> WaypointNote | None:
        """The first waypoint, or None once it is forgotten."""
        return next((w for w in self.variables.waypoints if w.id == 1), None)

    @property
    def height(self) -> float:
        """Metres above the ground: measured, or where that is too far by the climb since the start.

        The start's height stands in the sentence about it that an earlier reply left.
        """
        start = self.start
        told = _HEIGHT.search(start.scene) if start is not None else None
        if start is None or told is None or self.scene.height <= MEASURED:
            return self.scene.height
        return max(float(told.group(1)) - start.height, MEASURED)

    @property
    def pending(self) -> tuple[FlightStep, ...]:
        """The steps still to be done, in order."""
        return tuple(step for step in self.steps if not step.done)

    def meant(self, leg: Leg) -> list[LandmarkSight]:
        """Returns the things in view that a leg may mean, nearest first.

        Where the task states its goal's place, a thing far from there is not what the flight ends
        at, although it looks the same.
        """
        sights = self.scene.matching(leg)
        told, stated = stated_direction(self.variables.task), self.stated()
        if leg.kind != "stop" or told is None or stated is None:
            return sights
        angle, doubt = math.radians(stated[1]), DOUBT + _DOUBT_SHARE * told.distance
        goal = stated[0] * math.cos(angle), stated[0] * math.sin(angle)
        return [s for s in sights if math.dist(s.position, goal) <= doubt]

    def reached(self, leg: Leg) -> LandmarkSight | None:
        """Returns the landmark of a leg if the aircraft is where the leg wants it."""
        for sight in self.meant(leg):
            if leg.kind == "over":
                there = sight.below
            elif leg.kind in ("past", "go"):
                there = sight.below or sight.distance <= PASSING
            else:
                reach = FAR_REACH if self.tried(DOWN) >= FAILED else REACH
                beside = sight.below or sight.distance <= BESIDE_REACH
                there = beside and abs(sight.drop) <= reach
            if there:
                return sight
        return None

    def lost(self, leg: Leg) -> bool:
        """Whether the last move was on the way to a leg's landmark, high, and has lost sight of it.

        Level views end above what is near, and the view straight down before it.
        """
        way = rf" to '[^']*{re.escape(leg.landmark)}[^']*': {ON_THE_WAY}"
        high = self.height > 2.0 * REACH
        return bool(leg.landmark) and high and bool(re.search(way, self.variables.last_action))

    def tried(self, direction: str) -> float:
        """Returns what earlier tries in a direction from here speak against it, metres."""
        texts = self.here.tried if self.here else ()
        own = [text for text in texts if text.startswith(f"{direction}: ")]
        failures = sum(text.startswith(f"{direction}: failed") for text in own)
        return FAILED * failures + 15.0 * (len(own) - failures)

    def stated(self) -> tuple[float, float] | None:
        """Returns (metres, degrees to the left) to the place that the task states, from here."""
        goal, start = stated_direction(self.variables.task), self.start
        if goal is None or start is None:
            return None
        to_start, heading = math.radians(start.bearing), math.radians(start.heading)
        angle = heading + math.radians(goal.bearing)
        x = start.distance * math.cos(to_start) + goal.distance * math.cos(angle)
        y = start.distance * math.sin(to_start) + goal.distance * math.sin(angle)
        return math.hypot(x, y), math.degrees(math.atan2(y, x))


def assess_flight(request: MllmRequest) -> FlightSituation:
    """Returns the situation that a language request in flight describes."""
    variables = request.variables
    assert isinstance(variables, LanguageVariables)
    scene = look_around(request.evidence or (), variables.views)
    if variables.todo is None:
        legs = plan_legs(variables.task, scene.height)
        steps = _from_history(legs, variables)
    else:
        steps = _from_list(variables.todo)
    return FlightSituation(variables, scene, tuple(steps))


def _from_list(todo: Sequence[TodoItem]) -> list[FlightStep]:
    """Returns the TODO list as steps; an item that is no leg counts as done."""
    steps = []
    for index, item in enumerate(todo, start=1):
        legs = parse_directive(item.content)
        if legs:
            steps.append(FlightStep(index, legs[0], item.status == "completed"))
    return steps


def _from_history(legs: Sequence[Leg], variables: LanguageVariables) -> list[FlightStep]:
    """Returns the plan with what the window of decisions shows as done: all there is without TDM.

    A landmark was reached where a flight to it arrived; heights and ways before it are done then.
    """
    texts = [note.text for note in variables.decisions]
    done = [bool(leg.landmark) and any(_arrived_at(leg, text) for text in texts) for leg in legs]
    last = max((i for i, reached in enumerate(done) if reached), default=-1)
    return [FlightStep(i + 1, leg, i < last or done[i]) for i, leg in enumerate(legs)]


def _arrived_at(leg: Leg, decision: str) -> bool:
    target = rf" to '[^']*{re.escape(leg.landmark)}[^']*': arrived"
    return re.search(target, decision) is not None
