"""The episode monitor: measures from the truth, and ends the episode with a named cause."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.common.value import AbstractValue
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import Context, EventStatus

from unilavira_drake.messages import (
    TERMINAL_STATES,
    LanguageAction,
    Message,
    NavigationStatus,
    Panorama,
)
from unilavira_drake.messages.metrics import UNCOUNTED, UNREACHABLE, EpisodeMetrics
from unilavira_drake.messages.people import PeopleTruth
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.ports import InputReader, Level, message_input, pose_input, pose_numbers
from unilavira_drake.scenario import Budgets

SHORTEST_STEP = 0.001
"""Path length counts steps of at least this length, metres."""
SMALLEST_TURN = math.radians(1.0)
"""A turn of this much is motion, radians."""
SHORTEST_FLIGHT = 0.25
"""An aircraft wavers in gusts: its path has steps of at least this length, metres."""
LEAST_YAW = math.radians(10.0)
"""A turn of this much is motion of an aircraft, radians."""
CONTACT_FORCE = 1.0
"""A weaker contact is none, newtons."""
FLOOR_NORMAL = math.cos(math.radians(45.0))
"""A contact whose normal is more upright than this carries the robot: no collision.  An aircraft is
carried only until it has taken off."""

DECISION_CALLS = ("decide", "recover")
"""The calls that choose a robot action."""


@dataclass(frozen=True)
class MonitorState(Message):
    """The metrics, and what was last seen of each input."""

    metrics: EpisodeMetrics = EpisodeMetrics()
    started: bool = False
    panorama: int = 0
    action: int = 0
    status: tuple[int, str] = (0, "arrived")
    takeoff: str = "arrived"
    """How far an aircraft's way up is: the latest state of goal 0."""
    yaw: float = 0.0
    counted: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the latest step of the path ended, metres."""
    in_contact: bool = False
    on_person: bool = False
    usage: tuple[ModelUsage, ...] = ()
    """Of each connected model."""
    spent: str = ""
    """The budget of the models that was found used up one tick ago."""


class EpisodeMonitor(Level):
    """Measures path, distance to the goal and collisions, and ends the episode.

    The causes are those of ``messages.metrics.CAUSES``.  The outcome is written in one tick and
    the simulation ends in the next, so that recorders see it.

    A budget of the models (calls, tokens, seconds, money; both models together) ends the episode
    one tick after the reply with which it was used up, so that a stop in that reply counts.  The
    money is what is known to be spent.

    Contacts are sampled once per period: a touch shorter than that can be missed, and two touches
    with a shorter gap count as one.  A robot that pushes against something is always seen.  What
    carries a robot on the ground is no collision; an aircraft that has taken off touches nothing.

    .. pydrake_system::

        name: EpisodeMonitor
        input_ports:
        - cheat_X_WB
        - language_action
        - panorama
        - navigation_status
        - contact_results
        - language_usage (optional)
        - vision_usage (optional)
        - cheat_people (optional)
        output_ports:
        - metrics

    Args:
        period: polling and sampling period, seconds.
        budgets: decisions, simulated time, stall time, and what the models may use.
        goal_distance: metres from a place (x, y, z) to the goal; None when the episode is not
            scored.
        flies: whether the robot is an aircraft.
    """

    def __init__(
        self,
        *,
        period: float,
        budgets: Budgets,
        goal_distance: Callable[[float, float, float], float] | None = None,
        flies: bool = False,
    ) -> None:
        # It writes whenever the robot moved, so it belongs to the plant's moments: see OFFSET.
        super().__init__(MonitorState(), period=period, offset=0.0)
        # Plain numbers: a caller's later change of the scenario must not reach a built System.
        self._budgets = dataclasses.replace(budgets)
        self._goal_distance = goal_distance
        self._flies = flies
        self._pose = pose_input(self, "cheat_X_WB")
        self._action = message_input(self, "language_action", LanguageAction())
        self._panorama = message_input(self, "panorama", Panorama())
        self._status = message_input(self, "navigation_status", NavigationStatus())
        self._contacts = InputReader(
            self, "contact_results", ContactResults, AbstractValue.Make(ContactResults())
        )
        self._usages = tuple(
            message_input(self, f"{role}_usage", ModelUsage()) for role in ("language", "vision")
        )
        self._people = message_input(self, "cheat_people", PeopleTruth())
        self.declare_output("metrics", lambda state: state.metrics, EpisodeMetrics())

    def step(self, context: Context, state: MonitorState) -> MonitorState | EventStatus:
        """Measures once; ends the simulation one tick after the cause was written."""
        if state.metrics.ended:
            return EventStatus.ReachedTermination(self, state.metrics.cause)
        time = context.get_time()
        action = self._action(context)
        new = self._follow_ring(context, self._follow_motion(context, state, time), action, time)
        new = self._follow_models(context, self._follow_contacts(context, new), time)
        new = self._follow_people(context, new)
        cause = _cause(new, action, self._budgets, time, spent=state.spent)
        if not cause and (new is state or new.metrics.time == time):
            return new
        return dataclasses.replace(
            new, metrics=dataclasses.replace(new.metrics, time=time, cause=cause)
        )

    def _follow_motion(self, context: Context, state: MonitorState, time: float) -> MonitorState:
        X_WB = pose_numbers(self._pose(context))
        x, y, z = X_WB[3::4]
        yaw = math.atan2(X_WB[4], X_WB[0])
        metrics = state.metrics
        step = metrics.distance_from(x, y, z) if state.started else 0.0
        least_turn = LEAST_YAW if self._flies else SMALLEST_TURN
        turned = abs(math.remainder(yaw - state.yaw, 2 * math.pi)) >= least_turn
        if state.started and step < SHORTEST_STEP:
            if not turned:
                return state
            metrics = dataclasses.replace(metrics, time=time, progress_time=time)
            return dataclasses.replace(state, metrics=metrics, yaw=yaw)
        distance = nearest = None
        if self._goal_distance is not None:
            distance = self._goal_distance(x, y, z)
            nearest = min(
                distance,
                math.inf if metrics.min_goal_distance is None else metrics.min_goal_distance,
            )
        counted = state.counted
        if self._flies and state.started:
            step = math.dist(counted, (x, y, z))
        counts = not (self._flies and state.started) or step >= SHORTEST_FLIGHT
        metrics = dataclasses.replace(
            metrics,
            time=time,
            x=x,
            y=y,
            z=z,
            path_length=metrics.path_length + (step if counts else 0.0),
            goal_distance=distance,
            min_goal_distance=nearest,
            progress_time=time if counts or turned else metrics.progress_time,
        )
        return dataclasses.replace(
            state,
            metrics=metrics,
            yaw=yaw if turned or not self._flies or not state.started else state.yaw,
            counted=(x, y, z) if counts else counted,
            started=True,
        )

    def _follow_ring(
        self, context: Context, state: MonitorState, action: LanguageAction, time: float
    ) -> MonitorState:
        panorama = self._panorama(context).n
        status = self._status(context)
        seen = (status.n, status.state)
        if (panorama, action.n, seen) == (state.panorama, state.action, state.status):
            return state
        decided = action.n > state.action and action.call in DECISION_CALLS
        metrics = dataclasses.replace(
            state.metrics, decisions=state.metrics.decisions + int(decided), progress_time=time
        )
        return dataclasses.replace(
            state,
            metrics=metrics,
            panorama=panorama,
            action=action.n,
            status=seen,
            takeoff=status.state if status.n == 0 else state.takeoff,
        )

    def _follow_contacts(self, context: Context, state: MonitorState) -> MonitorState:
        carried = not self._flies or _stands(state)
        force = _collision_force(self._contacts(context), carried=carried)
        touching = force > CONTACT_FORCE
        metrics = state.metrics
        if touching == state.in_contact and force <= metrics.max_contact_force:
            return state
        onset = touching and not state.in_contact
        metrics = dataclasses.replace(
            metrics,
            collisions=metrics.collisions + int(onset),
            max_contact_force=max(metrics.max_contact_force, force),
        )
        return dataclasses.replace(state, metrics=metrics, in_contact=touching)

    def _follow_people(self, context: Context, state: MonitorState) -> MonitorState:
        people = self._people.optional(context)
        if people is None or people.gap is None:
            return state
        least, touched = state.metrics.min_person_distance, people.touched
        nearest = min(math.inf if least is None else least, people.gap)
        if nearest == (math.inf if least is None else least) and touched == state.on_person:
            return state
        metrics = dataclasses.replace(
            state.metrics,
            min_person_distance=None if math.isinf(nearest) else nearest,
            person_contacts=state.metrics.person_contacts + int(touched and not state.on_person),
        )
        return dataclasses.replace(state, metrics=metrics, on_person=touched)

    def _follow_models(self, context: Context, state: MonitorState, time: float) -> MonitorState:
        seen = tuple(reader.optional(context) for reader in self._usages)
        usage = tuple(one for one in seen if one is not None)
        if usage == state.usage:
            return state
        spent = _spent(sum(usage, ModelUsage()), self._budgets)
        metrics = dataclasses.replace(state.metrics, progress_time=time)
        return dataclasses.replace(state, metrics=metrics, usage=usage, spent=spent)


def _spent(usage: ModelUsage, budgets: Budgets) -> str:
    metered = budgets.model_tokens is not None or budgets.model_cost_usd is not None
    if metered and usage.uncounted:
        return UNCOUNTED
    for cause, used, limit in (
        ("call_budget", usage.calls, budgets.model_calls),
        ("token_budget", usage.tokens, budgets.model_tokens),
        ("model_time_budget", usage.seconds, budgets.model_seconds),
        ("cost_budget", usage.spent_usd, budgets.model_cost_usd),
    ):
        if limit is not None and used >= limit:
            return cause
    return ""


def _cause(
    state: MonitorState, action: LanguageAction, budgets: Budgets, time: float, *, spent: str
) -> str:
    if any(usage.failure for usage in state.usage):
        return UNREACHABLE
    if action.tool == "stop":
        return "stopped"
    if spent:
        return spent
    decisions = math.inf if budgets.decisions is None else budgets.decisions
    if state.metrics.decisions >= decisions and _asks_again(state, action):
        return "decision_budget"
    if budgets.simulated_time is not None and time >= budgets.simulated_time:
        return "time_budget"
    # However long a model thinks: its own deadline ends that.
    thinking = any(usage.thinking for usage in state.usage)
    if not thinking and time - state.metrics.progress_time >= budgets.stall:
        return "stalled"
    return ""


def _asks_again(state: MonitorState, action: LanguageAction) -> bool:
    """Whether the action is carried out, and what follows is a decision and no check of a stop."""
    number, status = state.status
    done = number == action.n and status in TERMINAL_STATES
    return done and action.tool != "double_check" and not action.confirmed


def _stands(state: MonitorState) -> bool:
    """Whether the floor may carry an aircraft: it takes off, or could not and never moved."""
    never_moved = state.metrics.path_length == 0.0
    return state.takeoff == "moving" or (state.takeoff == "failed" and never_moved)


def _collision_force(contacts: ContactResults, *, carried: bool) -> float:
    """The largest force of a contact, newtons; not the floor's while that carries the robot."""
    largest = 0.0
    for index in range(contacts.num_point_pair_contacts()):
        info = contacts.point_pair_contact_info(index)
        if not carried or abs(info.point_pair().nhat_BA_W[2]) < FLOOR_NORMAL:
            fx, fy, fz = info.contact_force()
            largest = max(largest, math.sqrt(fx * fx + fy * fy + fz * fz))
    return largest
