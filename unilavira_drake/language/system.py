"""The language level: asks the large model once per number and publishes its action."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.systems.framework import Context

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.language.next_call import next_call
from unilavira_drake.language.reply import CONTENT_LIMIT, parse_language_reply
from unilavira_drake.language.variables import language_request
from unilavira_drake.messages import (
    Frame,
    History,
    LanguageAction,
    Message,
    Panorama,
    SecondChance,
    TodoList,
    TodoUpdate,
)
from unilavira_drake.messages.people import PeopleTracks
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.ports import Level, message_input
from unilavira_drake.tasks import TaskSpec

MAX_REASKS = 1
"""A reply that cannot be used is asked for once more, with what was wrong; a refusal is not."""


@dataclass(frozen=True)
class LanguageState(Message):
    """The latest action and the latest request."""

    action: LanguageAction = LanguageAction()
    request: MllmRequest = MllmRequest()


class Language(Level):
    """Turns panorama n, history n and TODO list n - 1 into language action n.

    A reply that cannot be used is re-asked once with what was wrong.  After that, and at once when
    an error takes the place of a reply, a documented safe action is published (``fallback``): the
    task itself as the only TODO item, no movement, a rejected stop, an empty answer.

    .. pydrake_system::

        name: Language
        input_ports:
        - task
        - panorama
        - history
        - second_chance (optional: unconnected = no Second Chance Backtrack)
        - todo_list (optional: unconnected = no TODO List Memory)
        - model_reply
        - people (optional)
        output_ports:
        - language_action
        - model_request

    Args:
        period: polling period, seconds.
        seed: the episode's seed, part of every request.
        can_climb: whether the prompt offers stairs.
        free_distance: metres free along the axis of a view.
        detector: evidence for a model declared ``ground_truth``; None for all others.
        view_detail: how finely the model looks at the four views, see ``ImagePart``.
        history_detail: how finely it looks at pictures of the past.
        stairs_barred: whether the prompt says that there are stairs and this robot takes none.
        reach: how far one move goes in flight, metres.
    """

    def __init__(
        self,
        *,
        period: float,
        seed: int,
        can_climb: bool,
        free_distance: Callable[[Frame], float],
        detector: Callable[[Frame], ViewEvidence] | None = None,
        view_detail: str = "medium",
        history_detail: str = "low",
        stairs_barred: bool = False,
        reach: float = 0.0,
    ) -> None:
        super().__init__(LanguageState(), period=period)
        self._seed = seed
        self._can_climb = can_climb
        self._stairs_barred = stairs_barred
        self._reach = reach
        self._free_distance = free_distance
        self._detector = detector
        self._view_detail = view_detail
        self._history_detail = history_detail
        self._task = message_input(self, "task", TaskSpec())
        self._panorama = message_input(self, "panorama", Panorama())
        self._history = message_input(self, "history", History())
        self._second_chance = message_input(self, "second_chance", SecondChance())
        self._todo_list = message_input(self, "todo_list", TodoList())
        self._people = message_input(self, "people", PeopleTracks())
        self._reply = message_input(self, "model_reply", MllmReply())
        self.declare_output("language_action", lambda state: state.action, LanguageAction())
        self.declare_output("model_request", lambda state: state.request, MllmRequest())

    def step(self, context: Context, state: LanguageState) -> LanguageState:
        """Asks when a new turn of the ring is complete; answers when the reply is visible."""
        if state.request.n == state.action.n:
            return self._ask(context, state)
        reply = self._reply(context)
        if (reply.n, reply.attempt) != (state.request.n, state.request.attempt):
            return state
        if reply.infrastructure:
            # The monitor ends the episode; nothing is to be decided in the agent's name.
            return state
        return self._conclude(state, reply)

    def _ask(self, context: Context, state: LanguageState) -> LanguageState:
        panorama = self._panorama(context)
        if panorama.n != state.action.n + 1:
            return state
        history = self._history(context)
        todo = self._todo_list.optional(context)
        second_chance = self._second_chance.optional(context)
        if history.n != panorama.n or (todo is not None and todo.n != state.action.n):
            return state
        if second_chance is not None and second_chance.n != panorama.n:
            return state
        task = self._task(context)
        request = language_request(
            call=next_call(
                state.action,
                panorama.outcome,
                family=task.family,
                has_todo=todo is not None,
                revert_only=second_chance is not None and second_chance.revert_only,
            ),
            seed=self._seed,
            task=task,
            panorama=panorama,
            history=history,
            second_chance=second_chance,
            todo=todo,
            last_action=state.action,
            can_climb=self._can_climb,
            free_distance=self._free_distance,
            detector=self._detector,
            view_detail=self._view_detail,
            history_detail=self._history_detail,
            people=self._people.optional(context),
            time=context.get_time(),
            stairs_barred=self._stairs_barred,
            reach=self._reach,
        )
        return dataclasses.replace(state, request=request)

    def _conclude(self, state: LanguageState, reply: MllmReply) -> LanguageState:
        request, problem = state.request, reply.error
        if not problem:
            try:
                action = parse_language_reply(reply.text, request)
                return dataclasses.replace(state, action=action)
            except ReplyFormatError as error:
                problem = str(error)
        if request.attempt < MAX_REASKS and (reply.unusable or not reply.error):
            again = dataclasses.replace(request, attempt=request.attempt + 1, feedback=problem)
            return dataclasses.replace(state, request=again)
        return dataclasses.replace(state, action=safe_action(request, problem))


def safe_action(request: MllmRequest, problem: str) -> LanguageAction:
    """Returns the documented action that takes the place of unusable replies."""
    action = LanguageAction(
        n=request.n, call=request.call, reason=f"model error: {problem}", fallback=True
    )
    if request.call == "plan_todo":
        assert isinstance(request.variables, LanguageVariables)
        whole_task = TodoUpdate(op="add", content=request.variables.task[:CONTENT_LIMIT])
        return dataclasses.replace(action, tool="stay", todo_updates=(whole_task,))
    if request.call == "double_check":
        return dataclasses.replace(action, tool="stay", confirmed=False)
    return dataclasses.replace(action, tool="stop" if request.call == "answer" else "none")
