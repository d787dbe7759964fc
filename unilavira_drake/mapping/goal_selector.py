"""The goal selector: one goal for each language action."""

from __future__ import annotations

from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Context, LeafSystem

from unilavira_drake.mapping.flight_goals import FlightGoals, flight_goal, flown_goal
from unilavira_drake.mapping.flights import find_flight
from unilavira_drake.mapping.projection import Projection, project_box, project_point
from unilavira_drake.mapping.storeys import SAME_STOREY
from unilavira_drake.messages import (
    NO_TARGET,
    STAIR_KINDS,
    Frame,
    Goal,
    History,
    LanguageAction,
    Message,
    Panorama,
    VisionAction,
)
from unilavira_drake.ports import message_input

NO_STAIRS = "no stairs"
"""Begins the reason why ``go_stair`` gives no goal."""


def select_goal(
    action: LanguageAction,
    vision: VisionAction,
    history: History,
    panorama: Panorama,
    *,
    max_range: float,
    flight: FlightGoals = FlightGoals(),  # noqa: B008 (frozen)
) -> Goal:
    """Returns the goal of a language action, or ``Goal(0)`` while its inputs are incomplete.

    ``turn`` goes to what the vision action selected; ``go_stair`` to the foot of the stairs that
    begin there, and over them; ``backtrack`` to the waypoint, to face its stored heading, if it is
    on the same storey; ``stay`` and ``double_check`` stay; ``none``, a vision action without a
    selection and stairs that are not seen well give no goal, with the reason; ``stop`` gives no
    goal at all: the ring rests.  In flight, that is with a view straight down, ``turn`` keeps off
    what was selected as ``flight`` says (``flight_goals``), and ``fly`` goes where its numbers say.
    """
    n = action.n
    if n == 0 or n != panorama.n or action.tool == "stop":
        return Goal(0)
    if action.tool in ("stay", "double_check"):
        return Goal(n, "stay")
    if action.tool == "backtrack":
        return _waypoint(action, history, panorama) if history.n == n else Goal(0)
    if action.tool == "fly":
        return flown_goal(action, panorama, flight)
    if action.tool not in ("turn", "go_stair"):
        return Goal(n, "none", reason=action.reason or "no usable action")
    if vision.n != n:
        return Goal(0)
    if action.tool == "go_stair":
        return _stairs(n, action, vision, panorama)
    return _selected(action, vision, panorama, max_range, flight)


def _waypoint(action: LanguageAction, history: History, panorama: Panorama) -> Goal:
    n, waypoint = action.n, None
    if action.waypoint is not None:
        waypoint = history.waypoint(action.waypoint)
    if waypoint is None:
        return Goal(n, "none", reason=f"unknown waypoint {action.waypoint}")
    rise = abs(waypoint.position[2] - panorama.position[2])
    if rise > SAME_STOREY and not panorama.in_flight:
        return Goal(
            n, "none", reason=f"waypoint {waypoint.id} is on another floor; take the stairs"
        )
    return Goal(n, "go", p_WG=waypoint.position, heading=waypoint.heading)


def _selected(
    action: LanguageAction,
    vision: VisionAction,
    panorama: Panorama,
    max_range: float,
    flight: FlightGoals,
) -> Goal:
    n = action.n
    direction = vision.direction or action.direction
    try:
        frame = panorama.frame(direction)
    except KeyError:
        return Goal(n, "none", reason=f"{NO_TARGET}: there is no view {direction!r}")
    projection = _projected(vision, frame, max_range)
    if panorama.in_flight:
        return flight_goal(action, projection, frame, panorama, _middle(vision), flight)
    if projection.p_WG is None:
        return Goal(n, "none", reason=f"{NO_TARGET}: {projection.reason}")
    return Goal(n, "go", p_WG=projection.p_WG, pixel=projection.pixel)


def _stairs(n: int, action: LanguageAction, vision: VisionAction, panorama: Panorama) -> Goal:
    direction = vision.direction or action.direction or "front"
    try:
        frame = panorama.frame(direction)
    except KeyError:
        return Goal(n, "none", reason=f"{NO_STAIRS}: there is no view {direction!r}")
    if vision.box is not None:
        u_min, v_min, u_max, v_max = vision.box
    elif vision.point is not None:
        (u_min, v_min), (u_max, v_max) = vision.point, vision.point
    else:
        why = vision.reason or "nothing was selected"
        return Goal(n, "none", reason=f"{NO_STAIRS}: {why}")
    floor = panorama.position[2]
    flight = find_flight(frame, (u_min, u_max), action.stair, floor)
    if flight.foot is None:
        return Goal(n, "none", reason=f"{NO_STAIRS}: {flight.reason}")
    return Goal(
        n,
        STAIR_KINDS[action.stair],
        p_WG=(*flight.foot, floor),
        heading=flight.heading,
        pixel=((u_min + u_max) / 2, (v_min + v_max) / 2),
    )


def _projected(vision: VisionAction, frame: Frame, max_range: float) -> Projection:
    if vision.box is not None:
        return project_box(
            vision.box,
            depth=frame.depth,
            intrinsics=frame.intrinsics,
            X_WC=frame.X_WC,
            max_range=max_range,
        )
    if vision.point is not None:
        return project_point(
            vision.point,
            depth=frame.depth,
            intrinsics=frame.intrinsics,
            X_WC=frame.X_WC,
            max_range=max_range,
        )
    return Projection(reason=vision.reason or "nothing was selected")


def _middle(vision: VisionAction) -> tuple[float, float] | None:
    """Returns the pixel that stands for a selection without depth."""
    if vision.box is None:
        return vision.point
    u_min, v_min, u_max, v_max = vision.box
    return (u_min + u_max - 1) / 2, (v_min + v_max - 1) / 2


class GoalSelector(LeafSystem):
    """Turns the language action and its vision action into one goal in the world.

    Stateless: the goal is a function of four messages with the same number.

    .. pydrake_system::

        name: GoalSelector
        input_ports:
        - vision_action
        - language_action
        - history
        - panorama
        output_ports:
        - goal

    Args:
        max_range: targets beyond this depth are refused, metres; in flight, approached.
        flight: how near and how far an aircraft goes; without a view straight down it has no
            effect.
    """

    def __init__(
        self,
        *,
        max_range: float = 10.0,
        flight: FlightGoals = FlightGoals(),  # noqa: B008 (frozen)
    ) -> None:
        super().__init__()
        self._max_range = max_range
        self._flight = flight
        # Drake invalidates a calculation whenever any level's state is written, ten times a
        # second; the projection is done once for the same four messages.
        self._memo: list[tuple[tuple[Message, ...], Goal]] = []
        self._vision = message_input(self, "vision_action", VisionAction())
        self._action = message_input(self, "language_action", LanguageAction())
        self._history = message_input(self, "history", History())
        self._panorama = message_input(self, "panorama", Panorama())
        readers = (self._vision, self._action, self._history, self._panorama)
        # Without these Drake would also count time, and select anew at every tick.
        self.DeclareAbstractOutputPort(
            "goal",
            lambda: AbstractValue.Make(Goal()),
            self._calc_goal,  # type: ignore[arg-type]
            prerequisites_of_calc={reader.ticket for reader in readers},
        )

    def _calc_goal(self, context: Context, output: AbstractValue) -> None:
        action, vision = self._action(context), self._vision(context)
        history, panorama = self._history(context), self._panorama(context)
        inputs = (action, vision, history, panorama)
        for known, goal in self._memo:
            if all(a is b for a, b in zip(known, inputs, strict=True)):
                output.set_value(goal)
                return
        goal = select_goal(
            action, vision, history, panorama, max_range=self._max_range, flight=self._flight
        )
        self._memo[:] = [(inputs, goal)]
        output.set_value(goal)
