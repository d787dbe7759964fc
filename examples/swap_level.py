"""A level of one's own: here the grounding model gives way to a fixed rule.

``vision`` chooses where in the chosen view to go.  This one always points at the floor in the
middle of the picture, so the agent still reasons, but walks without looking.
"""

import dataclasses

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import LanguageAction, Panorama, TodoList, VisionAction
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.ports import Level, message_input
from unilavira_drake.tasks import TaskSpec


class StraightAhead(Level):
    """Answers every ``turn`` with the same pixel."""

    def __init__(self) -> None:
        super().__init__(VisionAction(), period=0.1)
        self.action = message_input(self, "language_action", LanguageAction())
        for name, default in (
            ("task", TaskSpec()),
            ("panorama", Panorama()),
            ("todo_list", TodoList()),
            ("model_reply", MllmReply()),
        ):
            message_input(self, name, default)
        self.declare_output("vision_action", lambda state: state, VisionAction())
        self.declare_output("model_request", lambda state: MllmRequest(), MllmRequest())

    def step(self, context, state):
        action = self.action(context)
        if action.tool != "turn" or action.n == state.n:
            return state
        point = VisionAction(point=(320.0, 330.0), target_desc="the floor ahead")
        return dataclasses.replace(point, n=action.n, direction=action.direction)


if __name__ == "__main__":
    scenario = load_scenario("flat", "budgets: {decisions: 8}")
    result = run_episode(scenario, replace={"vision": StraightAhead()})
    print(f"{result.cause}; success: {result.success}; {result.counts}")
