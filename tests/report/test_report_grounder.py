"""What the report tells of the auxiliary grounder, on paper and in an episode."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from run_on_paper import REFINED, TASK, Pen, write_run

from unilavira_drake.episode import run_episode
from unilavira_drake.messages import (
    Candidate,
    Goal,
    Grounding,
    LanguageAction,
    Outcome,
    VisionAction,
)
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.latency import NoLatency
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.model_link import ModelLink
from unilavira_drake.recording.run_folder import RunFolder
from unilavira_drake.report.model import read_run
from unilavira_drake.report.page import render_report
from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.vision.grounding import IT_IS_HERE

BOX = (100.0, 120.0, 300.0, 330.0)
MARK = VisionAction(1, "front", BOX, None, "the hallway", 0.9)


def article(page: str, n: int) -> str:
    """Returns the words of a step."""
    html = page.partition(f'id="step={n}"')[2].partition("</article>")[0]
    return " ".join(re.sub(r"<[^>]+>", " ", html).split())


def page_of(path: Path, grounding: Grounding | None) -> str:
    with RunFolder(path) as folder:
        pen = Pen(folder)
        pen.look(1, 1, 2.6, 7.4, Outcome())
        pen.act(LanguageAction(1, "decide", "turn", "front"))
        pen.say("vision", "vision_action", MARK if grounding is None else grounding.action)
        if grounding is not None:
            pen.say("grounder", "grounding", grounding)
        pen.drive(Goal(1, "go", p_WG=(2.2, 5.0, 0.0), pixel=(200.0, 225.0)), (2.6, 7.4))
    return render_report(path)


def test_a_grounding_is_read_as_it_was_said(tmp_path: Path) -> None:
    run = read_run(write_run(tmp_path / "run"))
    assert run.task == TASK
    second, third = run.steps[1:3]
    assert second.vision is not None
    assert second.vision.confidence == 0.3
    assert second.grounding is not None
    assert second.grounding.action.box == second.grounding.candidates[0].box == REFINED
    assert second.grounding.refined
    assert third.grounding is not None
    assert run.steps[0].grounding is None


def test_a_refined_mark_is_told_with_its_reason(tmp_path: Path) -> None:
    page = render_report(write_run(tmp_path / "run"))
    text = article(page, 2)
    for words in (
        "mark refined",
        "The model&#39;s mark was doubted (low confidence) and refined by the grounder.",
        "the model's confidence 0.30",
        "box 100, 120, 300, 330",
        "refined, score 0.90: box 340, 150, 480, 310",
        "1 more found, score 0.60",
        "&#34;grounding&#34;: {",
    ):
        assert words in text, words
    assert 'class="refined" x="340.0" y="150.0" width="140.0" height="160.0"' in page
    assert "and the refined mark" in page
    # Without a mark there is nothing to be mended.
    assert "mark was" not in article(page, 3)
    assert "marks doubted 1 of 2, 1 refined" in re.sub(r"(<[^>]+>|\s)+", " ", page)


@pytest.mark.parametrize(
    ("grounding", "words", "badge"),
    [
        (Grounding(1, MARK), "The model&#39;s mark was kept: it was not doubted.", False),
        (
            Grounding(1, MARK, "too close", (Candidate(BOX, 0.9),), reason=IT_IS_HERE),
            f"was kept, though doubted (too close): {IT_IS_HERE}.",
            True,
        ),
        (None, "", False),
    ],
)
def test_a_mark_that_stays_is_told_with_its_reason(
    tmp_path: Path, grounding: Grounding | None, words: str, badge: bool
) -> None:
    page = page_of(tmp_path / "run", grounding)
    text = article(page, 1)
    assert words in text
    assert ("mark doubted" in text) == badge
    assert ("1 more found, score 0.90" in text) == badge
    assert 'class="refined"' not in page
    if grounding is None:
        assert "mark was" not in text
        assert "marks doubted" not in page


class Doubtful(RulesModel):
    """Marks as ``rules`` does, and is not sure of it."""

    def complete(self, request: Any) -> Completion:
        reply = json.loads(super().complete(request).text)
        return Completion(json.dumps({**reply, "confidence": 0.2}))


def test_the_page_of_an_episode_tells_every_grounding(tmp_path: Path) -> None:
    said: list[Grounding] = []
    overlay = {"grounder": "label", "task": {"text": "@couch"}, "budgets": {"decisions": 3}}
    run_episode(
        load_scenario("flat", json.dumps(overlay)),
        out=tmp_path / "run",
        on_event=lambda t, system, event, message: (
            said.append(message) if event == "grounding" else None
        ),
        replace={
            "vision_link": ModelLink(broker=Broker(Doubtful()), latency=NoLatency(), period=0.1)
        },
    )
    page = render_report(tmp_path / "run")
    assert "Auxiliary grounder: reads the simulator&#39;s labels." in page
    assert any(grounding.refined for grounding in said)
    for grounding in said:
        text = article(page, grounding.n)
        assert "doubted (low confidence)" in text
        assert ("refined by the grounder" in text) == grounding.refined
        assert grounding.reason in text
    steps = {step.n: step.grounding for step in read_run(tmp_path / "run").steps}
    assert [steps[grounding.n] for grounding in said] == said
