"""The vision level: asks the grounding model where in the chosen view to go."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.systems.framework import Context

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.messages import (
    Frame,
    LanguageAction,
    Message,
    Panorama,
    TodoList,
    VisionAction,
)
from unilavira_drake.mllm.evidence import ViewEvidence
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.mllm.request import VIEW_LABEL, ImagePart, MllmRequest, VisionVariables
from unilavira_drake.ports import Level, message_input
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.vision.reply import parse_vision_reply

MAX_REASKS = 1
"""A reply that cannot be used is asked for once more, with what was wrong; a refusal is not."""


@dataclass(frozen=True)
class VisionState(Message):
    """The latest vision action and the latest request."""

    action: VisionAction = VisionAction()
    request: MllmRequest = MllmRequest(role="vision", call="ground")


class Vision(Level):
    """Turns language action n (``turn``, ``go_stair``) and panorama n into vision action n.

    No usable box or point is re-asked once; then the action selects nothing, which the goal
    selector turns into ``none`` and the ring into the outcome ``failed: no target``.

    .. pydrake_system::

        name: Vision
        input_ports:
        - task
        - language_action
        - panorama
        - todo_list (optional)
        - model_reply
        output_ports:
        - vision_action
        - model_request

    Args:
        period: polling period, seconds.
        seed: the episode's seed, part of every request.
        detector: evidence for a model declared ``ground_truth``; None for all others.
        box_space: how the model writes places in a picture, a key of ``boxes.BOX_SPACES``.
    """

    def __init__(
        self,
        *,
        period: float,
        seed: int,
        detector: Callable[[Frame], ViewEvidence] | None = None,
        box_space: str = "pixels",
    ) -> None:
        super().__init__(VisionState(), period=period)
        self._seed = seed
        self._detector = detector
        self._box_space = box_space
        self._task = message_input(self, "task", TaskSpec())
        self._language_action = message_input(self, "language_action", LanguageAction())
        self._panorama = message_input(self, "panorama", Panorama())
        self._todo_list = message_input(self, "todo_list", TodoList())
        self._reply = message_input(self, "model_reply", MllmReply())
        self.declare_output("vision_action", lambda state: state.action, VisionAction())
        self.declare_output("model_request", lambda state: state.request, MllmRequest())

    def step(self, context: Context, state: VisionState) -> VisionState:
        """Asks for a target of the language action; publishes it when the reply is visible."""
        if state.request.n == state.action.n:
            return self._ask(context, state)
        reply = self._reply(context)
        if (reply.n, reply.attempt) != (state.request.n, state.request.attempt):
            return state
        if reply.infrastructure:
            # The monitor ends the episode; nothing is to be decided in the agent's name.
            return state
        return self._conclude(state, reply)

    def _ask(self, context: Context, state: VisionState) -> VisionState:
        action = self._language_action(context)
        if action.tool not in ("turn", "go_stair") or action.n == state.request.n:
            return state
        panorama = self._panorama(context)
        todo = self._todo_list.optional(context)
        if panorama.n != action.n or (todo is not None and todo.n != action.n):
            return state
        task = self._task(context)
        direction = action.direction or "front"
        frame = panorama.frame(direction)
        request = MllmRequest(
            role="vision",
            n=action.n,
            seed=self._seed,
            call="ground",
            variables=VisionVariables(
                family=task.family,
                task=task.text,
                direction=direction,
                progress_analysis=action.progress_analysis,
                reasoning_action=action.reasoning_action,
                stair=action.stair if action.tool == "go_stair" else "",
                todo=None if todo is None else todo.items,
                width=frame.intrinsics.width,
                height=frame.intrinsics.height,
                box_space=self._box_space,
                in_flight=panorama.in_flight,
            ),
            images=(ImagePart(f"{VIEW_LABEL}{direction}", frame.jpeg, "high"),),
            evidence=None if self._detector is None else (self._detector(frame),),
        )
        return dataclasses.replace(state, request=request)

    def _conclude(self, state: VisionState, reply: MllmReply) -> VisionState:
        request, problem = state.request, reply.error
        if not problem:
            try:
                action = parse_vision_reply(reply.text, request)
                return dataclasses.replace(state, action=action)
            except ReplyFormatError as error:
                problem = str(error)
        if request.attempt < MAX_REASKS and (reply.unusable or not reply.error):
            again = dataclasses.replace(request, attempt=request.attempt + 1, feedback=problem)
            return dataclasses.replace(state, request=again)
        assert isinstance(request.variables, VisionVariables)
        nothing = VisionAction(
            n=request.n,
            direction=request.variables.direction,
            reason=problem,
            fallback=True,
        )
        return dataclasses.replace(state, action=nothing)
