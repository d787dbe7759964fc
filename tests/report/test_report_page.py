from __future__ import annotations

import base64
import dataclasses
import hashlib
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from run_on_paper import HOSTILE, TASK, write_run

from unilavira_drake.cli.main import main
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.recording.result import (
    EpisodeResult,
    JudgeResult,
    MetricsResult,
    UsageResult,
)
from unilavira_drake.report.page import render_report


class Outline(HTMLParser):
    """Collects what an HTML page is made of."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]

    def values(self, name: str) -> list[str]:
        return [value for _, key, value in self.attributes if key == name]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("page") / "run")


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return render_report(folder)


def test_what_a_model_wrote_stays_text(page: str) -> None:
    outline = Outline(page)
    assert HOSTILE not in page
    assert "&lt;script&gt;window.hacked = 1&lt;/script&gt;" in page
    assert outline.tags.count("script") == 1
    assert "img" not in outline.tags
    assert not [name for _, name, _ in outline.attributes if name.startswith("on")]
    assert "<b>bedroom</b>" not in page
    assert "the reply is &lt;i&gt;not JSON" in page


def test_the_page_needs_nothing_from_outside(page: str) -> None:
    outline = Outline(page)
    for name in ("src", "href", "xlink:href", "action"):
        assert all(value.startswith(("#", "data:")) for value in outline.values(name)), name
    assert "style" not in {name for _, name, _ in outline.attributes}
    assert "url(" not in page
    assert "@import" not in page


def test_the_policy_names_the_only_style_and_script(page: str) -> None:
    policy = next(value for value in Outline(page).values("content") if "default-src" in value)
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert "unsafe" not in policy
    for tag in ("style", "script"):
        (text,) = re.findall(rf"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy


def test_every_target_and_label_exists_once(page: str) -> None:
    outline = Outline(page)
    ids = outline.values("id")
    assert len(ids) == len(set(ids))
    assert {value[1:] for value in outline.values("href") if value.startswith("#")} <= set(ids)
    assert set(outline.values("aria-labelledby")) <= set(ids)
    assert {f"step={n}" for n in range(1, 7)} <= set(ids)


def test_each_picture_is_there_once(page: str) -> None:
    # Four views of one colour each, however many panoramas show them.
    assert page.count("data:image/jpeg;base64,") == 4
    assert Outline(page).tags.count("symbol") == 4


def test_the_page_says_what_happened_in_words(page: str) -> None:
    text = re.sub(r"<[^>]+>|\s+", " ", page)
    text = re.sub(r" +", " ", text)
    for words in (
        "Leave the &lt;b&gt;bedroom&lt;/b&gt; &amp; stop at the sofa.",
        "rules on the simulator&#39;s labels, not a multimodal LLM",
        "The agent ended the episode by its own verified stop.",
        "completion rolled back",
        "was: Enter the hall",
        "rewritten",
        "removed",
        "opened again",
        "Asked again because: the reply is",
        "Fallback: no reply could be used",
        "Failed: no target: no box.",
        "drive back to waypoint 1",
        "representative pixel 200, 225",
        "in the world (2.20, 5.00, 0.00) m, 2.4 m away",
        "the panorama of step 1 again",
        "The agent ends the episode here.",
    ):
        assert words in text, words


def test_a_judge_stands_beside_the_exact_match(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", result=False)
    usage = Usage(300, 30, 0, 0.25)
    judged = EpisodeResult(
        success=False,
        cause="stopped",
        metrics=MetricsResult(answer="pink", answer_correct=False, answer_score=0.75),
        judge=JudgeResult("a judge", 4, HOSTILE),
        usage=UsageResult.of(ModelUsage(), ModelUsage(), ModelUsage(1, 0, 1, usage)),
    )
    (folder / "result.json").write_text(judged.to_json())
    page = render_report(folder)
    assert HOSTILE not in page
    text = re.sub(r"(<[^>]+>|\s)+", " ", page)
    for words in (
        "answer pink answer correct no answer score 0.75 (4 of 5 by a judge)",
        "the judge&#39;s reason &lt;script&gt;window.hacked = 1",
        "tokens 300 in, 30 out; the judge&#39;s part 300 in, 30 out",
        "cost 0.2500 USD; the judge&#39;s part 0.2500 USD",
    ):
        assert words in text, words
    failed = dataclasses.replace(judged, judge=JudgeResult("a judge"), error="judge_model: down")
    (folder / "result.json").write_text(failed.to_json())
    assert "answer score none: judge_model: down" in re.sub(
        r"(<[^>]+>|\s)+", " ", render_report(folder)
    )


def test_the_scenario_s_judge_is_named(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    path = folder / "scenario.yaml"
    path.write_text(path.read_text().replace("judge_model: ''", "judge_model: mailbox:letters"))
    assert "Judge of answers: a human answers through the folder letters." in render_report(folder)


def test_the_same_run_has_the_same_page(folder: Path, page: str) -> None:
    assert render_report(folder) == page


def test_missing_pictures_are_told(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    first, second, *_ = sorted((folder / "frames").iterdir())
    first.unlink()
    second.write_bytes(b"\xff\xd8 no picture")
    for path in (folder / "maps").iterdir():
        path.unlink()
    page = render_report(folder)
    assert f"frames/{first.name} is missing." in page
    assert f"frames/{second.name} is no picture." in page
    assert page.count("data:image/jpeg") == 2
    assert "picture missing" in page
    assert "The occupancy map of this step is missing." in page


def test_a_digest_is_a_name_and_never_a_path(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    (tmp_path / "secret.jpg").write_bytes(next((folder / "frames").iterdir()).read_bytes())
    path = folder / "transcript.jsonl"
    digest = next((folder / "frames").iterdir()).stem
    path.write_text(path.read_text().replace(digest, "../../secret"))
    page = render_report(folder)
    assert page.count("data:image/jpeg") == 3
    assert "frames/../../secret.jpg is missing." in page


@pytest.mark.parametrize("scenario", [None, "no: such: yaml", "world: {name: gone.yaml}"])
def test_without_its_scenario_a_run_has_maps_without_rooms(
    tmp_path: Path, scenario: str | None
) -> None:
    folder = write_run(tmp_path / "run", scenario=False)
    if scenario is not None:
        (folder / "scenario.yaml").write_text(scenario)
    page = render_report(folder)
    assert "aps are without rooms and furniture" in page
    assert 'class="wall"' not in page
    assert 'class="pose"' in page
    # The result still says what the model is.
    assert "not a multimodal LLM" in page


def test_a_run_that_never_began_has_a_page(tmp_path: Path) -> None:
    (tmp_path / "transcript.jsonl.partial").write_text("")
    page = render_report(tmp_path)
    for words in ("No step was recorded", "unfinished", "The run did not end"):
        assert words in page


def test_the_command_writes_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_run(tmp_path / "run")
    assert main(["report", str(folder)]) == 0
    assert re.search(r"report\.html \(0\.\d MB\)", capsys.readouterr().out.replace("\n", ""))
    written = (folder / "report.html").read_text(encoding="utf-8")
    assert written == render_report(folder)
    other = tmp_path / "elsewhere.html"
    assert main(["report", str(folder), "--out", str(other)]) == 0
    assert other.read_text(encoding="utf-8") == written
    assert not list(tmp_path.rglob("*.partial"))


def test_half_a_surrogate_pair_can_be_written(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    path = folder / "transcript.jsonl"
    path.write_text(path.read_text().replace("a bedroom", "a \\ud800 bedroom"))
    assert main(["report", str(folder)]) == 0


def test_bad_input_has_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_run(tmp_path / "run")
    for arguments, fragment in (
        ([], "DIR"),
        ([str(tmp_path / "none")], "does not exist"),
        ([str(tmp_path)], "is no run folder"),
        ([str(folder), "--out", str(tmp_path / "no" / "page.html")], "cannot be written"),
        ([str(folder), "--out", str(tmp_path)], "cannot be written"),
    ):
        assert main(["report", *arguments]) == 2
        error = capsys.readouterr().err
        assert fragment in error
        assert "Traceback" not in error
    assert not list(tmp_path.rglob("*.partial"))
    assert TASK in (folder / "scenario.yaml").read_text()
