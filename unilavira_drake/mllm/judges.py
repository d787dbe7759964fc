"""Which models may judge an answer."""

from __future__ import annotations

from unilavira_drake.errors import ScenarioError
from unilavira_drake.mllm.backends import make_backend
from unilavira_drake.mllm.reply import Mllm


def make_judge(spec: str, *, place: str = "judge_model") -> Mllm:
    """Returns the model that a spec names, as a judge of answers.

    Raises:
        ScenarioError: if the spec names nothing that can be used, or a program of rules, which
            reads no free words.
    """
    judge = make_backend(spec, role="judge", place=place)
    if judge.reasoning == "rules":
        raise ScenarioError(
            f"{place}: {spec!r} follows rules and cannot judge the words of an answer; give a "
            "model that reads (PROFILE, PROFILE.yaml, openai:MODEL@BASE_URL), mailbox:DIR for a "
            "person, or leave it empty."
        )
    return judge
