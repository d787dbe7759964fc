"""The prompts of whole episodes: what stays the same, what is shown, how finely."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.mllm.prompt import Prompt, compose_prompt
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.request import ImagePart, MllmRequest
from unilavira_drake.mllm.rules.model import RulesModel

AFTER_THE_PAST = "\nWHERE THE ROBOT HAS BEEN\n"
KEPT = 8


def asked(scenario: str, overlay: str) -> list[MllmRequest]:
    """Returns every request of an episode that ``rules`` answers."""
    requests: list[MllmRequest] = []
    answer: Callable[[RulesModel, MllmRequest], Completion] = RulesModel.complete

    def complete(self: RulesModel, request: MllmRequest) -> Completion:
        requests.append(request)
        return answer(self, request)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RulesModel, "complete", complete)
        run_episode(load_scenario(scenario, overlay))
    return requests


@pytest.fixture(scope="module")
def requests() -> list[MllmRequest]:
    return asked("apartment", "task: {text: '@storage'}")


@pytest.fixture(scope="module")
def prompts(requests: list[MllmRequest]) -> list[Prompt]:
    return [compose_prompt(request) for request in requests if request.role == "language"]


def past(prompt: Prompt) -> list[ImagePart]:
    return [image for image in prompt.images if image.label.startswith("H")]


def sent(prompt: Prompt) -> str:
    """Returns the user's part up to what changes, each picture as its hash."""
    texts = (
        f"<{hashlib.sha256(part.jpeg).hexdigest()}>\n" if isinstance(part, ImagePart) else part
        for part in prompt.parts
    )
    return "".join(texts).partition(AFTER_THE_PAST)[0].rstrip("\n")


def size(image: ImagePart) -> tuple[int, int]:
    height, width = cv2.imdecode(np.frombuffer(image.jpeg, np.uint8), cv2.IMREAD_COLOR).shape[:2]
    return width, height


def test_prompts_begin_alike_up_to_the_new_pictures(prompts: list[Prompt]) -> None:
    assert len({prompt.system for prompt in prompts}) == 1
    assert len({str(prompt.parts[0]).partition("\nH")[0] for prompt in prompts[1:]}) <= 2
    grown = dropped = 0
    for before, after in itertools.pairwise(prompts):
        old, new = past(before), past(after)
        if new[: len(old)] == old:
            assert sent(after).startswith(sent(before))
            grown += len(new) > len(old)
        else:
            kept = [image for image in old if image in new]
            assert new[: len(kept)] == kept
            assert len(old) + len(new) - 2 * len(kept) >= 4
            gone = [image for image in old if image not in new]
            # Views at waypoints go only once there is none from the way.
            ways = ["leaving" in image.label for image in gone]
            assert ways == sorted(ways, reverse=True) or all(ways)
            dropped += 1
    assert grown >= 3
    assert dropped >= 1


def test_nothing_that_changes_stands_before_the_pictures(prompts: list[Prompt]) -> None:
    heads = {sent(prompt).partition("\nH")[0] for prompt in prompts}
    assert len(heads) == 1
    assert "Task: " in heads.pop()


def test_eight_small_pictures_of_the_past_and_four_views(prompts: list[Prompt]) -> None:
    counts = [len(past(prompt)) for prompt in prompts]
    enough = next(i for i, count in enumerate(counts) if count >= KEPT)
    assert all(KEPT <= count < KEPT + 4 for count in counts[enough:])
    for prompt in prompts:
        views = prompt.images[len(past(prompt)) :]
        assert [view.label for view in views] == [
            f"view {direction}" for direction in ("front", "left", "right", "back")
        ]
        assert {(size(view), view.detail) for view in views} == {((640, 480), "medium")}
        assert {(size(image), image.detail) for image in past(prompt)} <= {((320, 240), "low")}
        jpegs = [image.jpeg for image in prompt.images]
        assert len(set(jpegs)) == len(jpegs)


def test_the_vision_model_gets_its_one_view_in_full(requests: list[MllmRequest]) -> None:
    for request in requests:
        if request.role == "vision":
            (image,) = compose_prompt(request).images
            assert (size(image), image.detail) == ((640, 480), "high")


def test_what_is_written_on_walls_is_only_in_the_pictures(requests: list[MllmRequest]) -> None:
    assert not any("GOAL REACHED" in compose_prompt(request).text for request in requests)


def test_the_paper_preset_sends_everything_in_full() -> None:
    requests = asked("flat", "{prompt_preset: paper, budgets: {decisions: 3}}")
    images = [image for request in requests for image in compose_prompt(request).images]
    assert {(size(image), image.detail) for image in images} == {((640, 480), "high")}
    assert any(image.label.startswith("H") for image in images)
