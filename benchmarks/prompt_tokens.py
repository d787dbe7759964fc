"""Input tokens of the language model's calls in a real episode.

    python benchmarks/prompt_tokens.py [--task yellow_bed] [--decision 10]

``rules`` chooses, so that there is a history; each prompt is counted as Gemini counts pictures
(280, 560 or 1,120 tokens for low, medium or high) and texts at four characters a token.  Prints
one JSON object a line; prompts with their split: ``rules`` (the part that never changes), ``text``
(all other words), ``history`` (pictures of the past), ``views``, ``schema`` (of the reply, which
Gemini counts as input).

* ``L2``: the ``decide`` call of the tenth decision.  Below it what it must show all the same: the
  least tokens of a view, pictures of the past, and TODO list and feedback in full (1: uncut).
* ``L2.most``: the dearest call up to there.
* ``L2.recover``: the ``recover`` call that shows most pictures of the way that failed.
* ``L2.paper``: the same ``decide`` call with every picture in full.  The paper states 22,300 on
  average over all calls.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from unittest import mock

from rendering import row

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.mllm.profile import ImageTokens
from unilavira_drake.mllm.profiles import load_profile
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.reply_schema import gemini_schema, request_schema
from unilavira_drake.mllm.request import LanguageVariables, MllmRequest
from unilavira_drake.mllm.rules.model import RulesModel
from unilavira_drake.mllm.tokens import picture_tokens, text_tokens

Row = Callable[..., None]
"""Prints one line: id, what, value, unit; target and sense by name."""


def language_requests(task: str, preset: str) -> list[MllmRequest]:
    """Returns what the language model was asked in an episode that ``rules`` answered."""
    requests: list[MllmRequest] = []
    answer: Callable[[RulesModel, MllmRequest], Completion] = RulesModel.complete

    def complete(self: RulesModel, request: MllmRequest) -> Completion:
        requests.append(request)
        return answer(self, request)

    with mock.patch.object(RulesModel, "complete", complete):
        run_episode(
            load_scenario("apartment", f"{{task: {{text: '@{task}'}}, prompt_preset: {preset}}}")
        )
    return [request for request in requests if request.role == "language"]


def tokens(request: MllmRequest, rule: ImageTokens) -> dict[str, int]:
    """Returns the split of a prompt's tokens."""
    prompt = compose_prompt(request)
    views = [image for image in prompt.images if image.label.startswith("view ")]
    past = [image for image in prompt.images if not image.label.startswith("view ")]
    schema = request_schema(request)
    written = "" if schema is None else json.dumps(gemini_schema(schema), separators=(",", ":"))
    return {
        "schema": text_tokens(written),
        "rules": text_tokens(prompt.system),
        "text": text_tokens("".join(part for part in prompt.parts if isinstance(part, str))),
        "history": sum(picture_tokens(image, rule) for image in past),
        "views": sum(picture_tokens(image, rule) for image in views),
        "history_pictures": len(past),
        "view_tokens_least": min(picture_tokens(image, rule) for image in views),
    }


def total(split: dict[str, int]) -> int:
    """Returns all tokens of a prompt."""
    return sum(split[part] for part in ("schema", "rules", "text", "history", "views"))


def in_full(request: MllmRequest) -> bool:
    """Whether TODO list and feedback stand in the prompt uncut."""
    variables, text = request.variables, compose_prompt(request).text
    assert isinstance(variables, LanguageVariables)
    items = variables.todo or ()
    told = [item.content for item in items] + [item.result for item in items]
    return all(words.replace('"', '\\"') in text for words in (*told, *variables.todo_feedback))


def token_rows(row: Row = row, task: str = "yellow_bed", decision: int = 10) -> None:
    """Prints the rows of a task of the apartment."""
    rule = load_profile("gemini-3.1-pro").image_tokens
    assert rule is not None
    requests = language_requests(task, "compact")
    chosen = decide_call(requests, decision)
    named = f"decide, decision {decision}"
    _token_row(row, "L2", f"{named}: input tokens", tokens(chosen, rule))
    _shown_rows(row, "L2", named, chosen, tokens(chosen, rule))
    before = [tokens(request, rule) for request in requests if request.n <= chosen.n]
    _token_row(row, "L2.most", f"the dearest call up to {named}", max(before, key=total))
    recoveries = [request for request in requests if request.call == "recover"]
    if recoveries:
        recover = max(recoveries, key=_failed_pictures)
        _token_row(row, "L2.recover", "recover: input tokens", tokens(recover, rule))
        _shown_rows(row, "L2.recover", "recover", recover, tokens(recover, rule))
        row("L2.recover.leg", "recover: pictures of the way that failed",
            _failed_pictures(recover), "pictures", target=4)  # fmt: skip
    split = tokens(decide_call(language_requests(task, "paper"), decision), rule)
    row("L2.paper", f"{named}, preset paper: input tokens", total(split), "tokens", **split)


def decide_call(requests: list[MllmRequest], decision: int) -> MllmRequest:
    """Returns the ``decide`` call of a decision, or the next after it."""
    decisions = [r for r in requests if r.call in ("decide", "recover") and not r.attempt]
    return next(r for r in decisions[decision - 1 :] if r.call == "decide")


def _failed_pictures(request: MllmRequest) -> int:
    assert isinstance(request.variables, LanguageVariables)
    labels = [image.label for image in compose_prompt(request).images]
    names = request.variables.failed_pictures
    return sum(any(label.startswith(f"{name}:") for label in labels) for name in names)


def _token_row(row: Row, id_: str, what: str, split: dict[str, int]) -> None:
    row(id_, what, total(split), "tokens", target=8000, sense="<=", paper=22_300, **split)


def _shown_rows(row: Row, id_: str, what: str, request: MllmRequest, split: dict[str, int]) -> None:
    row(f"{id_}.view", f"{what}: least tokens of a view", split["view_tokens_least"], "tokens",
        target=560)  # fmt: skip
    row(f"{id_}.history", f"{what}: pictures of the past", split["history_pictures"], "pictures",
        target=8)  # fmt: skip
    row(f"{id_}.todo", f"{what}: TODO list and feedback in full", in_full(request), "1",
        target=1)  # fmt: skip


def main() -> None:
    """Runs from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--task", default="yellow_bed")
    parser.add_argument("--decision", type=int, default=10)
    arguments = parser.parse_args()
    token_rows(row, arguments.task, arguments.decision)


if __name__ == "__main__":
    main()
