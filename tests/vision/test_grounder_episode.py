"""Both grounders on rendered pictures and in an episode."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from unilavira_drake.episode import run_episode
from unilavira_drake.errors import ScenarioError
from unilavira_drake.messages import Frame, Grounding, Panorama, VisionAction
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.latency import NoLatency
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.model_link import ModelLink
from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.sensors.detections import GroundTruthDetector
from unilavira_drake.sensors.grounder_colors import color_candidates
from unilavira_drake.sensors.grounder_labels import LabelGrounder
from unilavira_drake.vision.grounding import GroundingLimits, Propose, from_pictures, ground
from unilavira_drake.worlds.load import load_world


class Doubtful(RulesModel):
    """Marks as ``rules`` does, and is not sure of it."""

    def complete(self, request: Any) -> Completion:
        reply = json.loads(super().complete(request).text)
        return Completion(json.dumps({**reply, "confidence": 0.2}))


def doubtful_episode(out: Path) -> list[Any]:
    """Returns the messages of a short episode with the label grounder."""
    said: list[Any] = []
    overlay = {"grounder": "label", "task": {"text": "@couch"}, "budgets": {"decisions": 3}}
    link = ModelLink(broker=Broker(Doubtful()), latency=NoLatency(), period=0.1)
    run_episode(
        load_scenario("flat", json.dumps(overlay)),
        out=out,
        on_event=lambda t, system, event, message: said.append(message),
        replace={"vision_link": link},
    )
    return said


@pytest.fixture(scope="module")
def living_room() -> Panorama:
    """What is seen on the way into the apartment's living room, where two sofas stand."""
    overlay = {
        "start": "4.0,3.6,-2.2",
        "task": {"text": "Go to the blue sofa."},
        "language_model": "frontier",
        "vision_model": "frontier",
        "budgets": {"decisions": 1},
    }
    said: list[Any] = []
    run_episode(
        load_scenario("apartment", json.dumps(overlay)), on_event=lambda *e: said.append(e[3])
    )
    return next(message for message in said if isinstance(message, Panorama))


def visible(panorama: Panorama, name: str) -> tuple[Frame, np.ndarray]:
    """Returns the view that shows most of a thing, and where it is in it."""
    label = load_world("apartment").label_of(name)
    frame = max(panorama.frames, key=lambda f: np.count_nonzero(f.label == label))
    return frame, frame.label == label


PROPOSERS = {
    "color": from_pictures(color_candidates),
    "label": LabelGrounder(GroundTruthDetector(load_world("apartment").labels)),
}


@pytest.mark.parametrize("name", ["sofa_1", "sofa_2", "armchair_1"])
@pytest.mark.parametrize("propose", PROPOSERS.values(), ids=PROPOSERS)
@pytest.mark.parametrize("shift", [-0.6, 0.0, 0.6])
def test_a_mark_beside_a_thing_is_moved_onto_it(
    living_room: Panorama, propose: Propose, name: str, shift: float
) -> None:
    frame, shown = visible(living_room, name)
    assert np.count_nonzero(shown) > 1000
    rows, columns = np.nonzero(shown)
    off = shift * (np.ptp(columns) + 1)
    words = {"sofa_1": "blue sofa", "sofa_2": "red couch", "armchair_1": "orange armchair"}
    action = VisionAction(
        n=1,
        direction=frame.view,
        box=(columns.min() + off, rows.min(), columns.max() + 1 + off, rows.max() + 1),
        target_desc=words[name],
        confidence=0.3,
    )
    found = ground(action, frame, living_room.position, propose, GroundingLimits())
    assert found.refined, found.reason
    assert found.action.point is not None
    u, v = found.action.point
    assert shown[round(v), round(u)]


def test_an_episode_tells_its_groundings(tmp_path: Path) -> None:
    said = doubtful_episode(tmp_path / "run")
    groundings = [m for m in said if isinstance(m, Grounding)]
    visions = [m for m in said if isinstance(m, VisionAction)]
    assert [g.n for g in groundings] == [v.n for v in visions]
    assert {g.doubt for g in groundings} == {"low confidence"}
    assert any(g.refined for g in groundings)
    lines = (tmp_path / "run" / "transcript.jsonl").read_text(encoding="utf-8").splitlines()
    told = [line for line in map(json.loads, lines) if line["event"] == "grounding"]
    assert [line["data"]["n"] for line in told] == [g.n for g in groundings]
    assert told[0]["system"] == "grounder"


@pytest.mark.parametrize(
    ("grounder", "perception"),
    [("none", "images"), ("color", "images"), ("label", "ground_truth")],
)
def test_labels_taint_the_result(grounder: str, perception: str) -> None:
    overlay = {
        "grounder": grounder,
        "language_model": "frontier",
        "vision_model": "frontier",
        "budgets": {"decisions": 1},
    }
    result = run_episode(load_scenario("flat", json.dumps(overlay)))
    assert result.model.perception == perception


def test_an_unknown_grounder_is_named() -> None:
    with pytest.raises(ScenarioError, match=r"unknown grounder 'colour'.*did you mean 'color'"):
        load_scenario("flat", "grounder: colour")
