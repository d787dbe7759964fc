"""Everything one decision is made from: plan, scene, memory and the last outcome."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass

from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.mllm.rules.clauses import Clause
from unilavira_drake.mllm.rules.memory import Place, recall
from unilavira_drake.mllm.rules.plan import Step, clauses_of, steps_from_history, steps_of
from unilavira_drake.mllm.rules.scene import Scene, look
from unilavira_drake.mllm.rules.sight import Sight

REACH = 1.3
"""A thing whose nearest visible part is this close counts as reached, metres."""
REACH_FROM_DOOR = 0.7
"""The same in a door, where the thing may stand in the other room, metres."""
THRESHOLD = 0.8
"""A door this close is one that the robot stands in or at, metres."""
APPROACHED = 2.0
"""The same, where an approach to the thing itself has just ended without an error, metres."""


@dataclass(frozen=True)
class Situation:
    """What the reasoner knows at one call."""

    variables: LanguageVariables
    scene: Scene
    places: tuple[Place, ...]
    """Remembered places, the present one included."""
    steps: tuple[Step, ...]
    key: int = 0
    """Seed of this call, for ties."""

    @property
    def here(self) -> Place | None:
        """The present waypoint as remembered."""
        current = self.variables.current_waypoint
        return next((p for p in self.places if p.id == current), None)

    @property
    def visited(self) -> tuple[Place, ...]:
        """Remembered places; the present one with the room that is now seen underfoot."""
        current = self.variables.current_waypoint
        return tuple(
            dataclasses.replace(p, room=self.scene.room) if p.id == current else p
            for p in self.places
        )

    @property
    def origin(self) -> Place | None:
        """The place from which the last move led here."""
        found = re.match(r"at waypoint (\d+): turn", self.variables.last_action)
        if found is None or self.variables.outcome != "arrived":
            return None
        return next((p for p in self.places if p.id == int(found.group(1))), None)

    @property
    def last_target(self) -> str:
        """What the last move went to, in words."""
        found = re.search(r" to '(.*?)'", self.variables.last_action)
        return found.group(1) if found else ""

    @property
    def pending(self) -> tuple[Step, ...]:
        """The steps still to be done, in order."""
        return tuple(step for step in self.steps if not step.done)

    @property
    def on_threshold(self) -> bool:
        """Whether the robot stands in or at a door, where two rooms are near."""
        return any(e.sight.distance < THRESHOLD for e in self.scene.exits)

    def reached(self, clause: Clause) -> Sight | None:
        """Returns the thing of a clause if the robot is beside it."""
        reach = REACH_FROM_DOOR if self.on_threshold else REACH
        for sight in self.scene.matching(clause):
            approached = self.last_target.endswith(sight.name) and self.origin is not None
            if sight.near <= (APPROACHED if approached else reach):
                return sight
        return None


def assess(request: MllmRequest) -> Situation:
    """Returns the situation that a language request describes."""
    variables = request.variables
    assert isinstance(variables, LanguageVariables)
    scene = look(request.evidence or (), variables.views)
    places = recall(variables)
    if variables.todo is None:
        start = next((place.room for place in places if place.room), scene.room)
        clauses = clauses_of(variables.task, variables.family, start)
        decisions = [note.text for note in variables.decisions]
        steps = steps_from_history(clauses, places, decisions)
    else:
        steps = steps_of(variables.todo)
    places = tuple(place for place in places if not place.elsewhere)
    return Situation(variables, scene, places, tuple(steps), request.seed * 1000 + request.n)
