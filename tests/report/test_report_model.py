from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from run_on_paper import TASK, write_run

from unilavira_drake.errors import InputError
from unilavira_drake.memory.todo import apply_updates
from unilavira_drake.messages import LanguageAction, TodoItem, TodoList, TodoUpdate
from unilavira_drake.mllm.reply import MllmReply
from unilavira_drake.recording.transcript import transcript_line
from unilavira_drake.report.model import RunRecord, read_run
from unilavira_drake.report.reading import read_transcript
from unilavira_drake.report.todo_change import todo_changes


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunRecord:
    return read_run(write_run(tmp_path_factory.mktemp("report") / "run"))


def changes(run: RunRecord, n: int) -> list[tuple[str, str, str]]:
    found = run.steps[n - 1].changes
    assert found is not None
    return [(change.kind, change.content, change.status) for change in found]


def test_every_step_is_read(run: RunRecord) -> None:
    assert run.problems == ()
    assert [(step.n, step.call) for step in run.steps] == [
        (1, "plan_todo"),
        (2, "decide"),
        (3, "decide"),
        (4, "decide"),
        (5, "decide"),
        (6, "double_check"),
    ]
    assert run.task == TASK
    assert run.trace.waypoints == {1: (2.6, 7.4), 2: (2.2, 5.0)}
    (span,) = run.trace.backtracks
    step = run.steps[4]
    assert span == (step.decided, step.ended)


def test_a_step_knows_what_was_seen_chosen_and_meant(run: RunRecord) -> None:
    step = run.steps[1]
    assert step.panorama is not None
    assert step.action is not None
    assert step.vision is not None
    assert step.goal is not None
    assert [frame.view for frame in step.panorama.frames] == ["front", "left", "back", "right"]
    assert step.panorama.first == 1
    assert (step.action.tool, step.action.direction) == ("turn", "left")
    assert step.vision.box == (100.0, 120.0, 300.0, 330.0)
    assert (step.goal.p_WG, step.goal.pixel) == ((2.2, 5.0, 0.0), (200.0, 225.0))
    assert step.status is not None
    assert step.status.state == "arrived"
    assert step.map is not None
    assert (step.map.n, step.map.shape, step.map.origin) == (2, (64, 64), (0.0, 4.0))


def test_questions_asked_again_and_fallbacks_are_kept(run: RunRecord) -> None:
    second, third, fourth = run.steps[1:4]
    assert [(a.role, a.attempt, a.complaint) for a in second.attempts] == [
        ("language", 0, ""),
        ("language", 1, "the reply is <i>not JSON</i>"),
        ("vision", 0, ""),
    ]
    texts = [attempt.reply.text for attempt in second.attempts if attempt.reply is not None]
    assert texts[0].startswith("no JSON <script>")
    assert texts[1:] == ['{"action": {}}', "{}"]
    assert [(s.reasks, s.fallback) for s in (second, third, fourth)] == [
        (1, False),
        (1, True),
        (1, True),
    ]
    assert third.status is not None
    assert (third.status.state, third.status.reason) == ("failed", "no target: no box")


def test_the_list_tells_what_became_of_each_item(run: RunRecord) -> None:
    assert changes(run, 1) == [
        ("added", "Leave the bedroom", "pending"),
        ("added", "Enter the hall", "pending"),
        ("added", "Pass the bench", "pending"),
    ]
    assert changes(run, 2) == [
        ("completed", "Leave the bedroom", "completed"),
        ("rolled_back", "Enter the hall", "pending"),
        ("kept", "Pass the bench", "pending"),
    ]
    assert "rolled back" in run.steps[1].feedback[0]
    assert changes(run, 3) == [
        ("kept", "Leave the bedroom", "completed"),
        ("rewritten", "Walk along the hall", "pending"),
        ("removed", "Pass the bench", "pending"),
        ("added", "Stop at the sofa", "pending"),
    ]
    rewritten = run.steps[2].changes[1]  # type: ignore[index]
    assert rewritten.before == "Enter the hall"
    assert {kind for kind, *_ in changes(run, 4)} == {"kept"}
    assert changes(run, 5)[0] == ("reopened", "Leave the bedroom", "pending")


words = st.sampled_from(["go out", "turn left", "find it", "stop there"])
items = st.lists(
    st.builds(TodoItem, words, st.sampled_from(["pending", "completed"]), st.just("seen it")),
    max_size=5,
)
operations = st.lists(
    st.builds(
        TodoUpdate,
        st.sampled_from(["update", "rewrite", "add", "remove"]),
        st.one_of(st.none(), st.integers(1, 6)),
        words,
        st.sampled_from(["", "pending", "completed"]),
        st.sampled_from(["", "a red door"]),
    ),
    max_size=4,
)


@settings(derandomize=True, deadline=None, max_examples=200)
@given(items, operations)
def test_changes_account_for_both_lists(before: list[TodoItem], updates: list[TodoUpdate]) -> None:
    old = TodoList(1, tuple(before))
    new = apply_updates(old, LanguageAction(2, "decide", todo_updates=tuple(updates)))
    found = todo_changes(before, new, updates)
    left = [change for change in found if change.kind != "removed"]
    assert [(c.content, c.status, c.result) for c in left] == [
        (item.content, item.status, item.result) for item in new.items
    ]
    came = sum(change.kind == "added" for change in found)
    went = sum(change.kind == "removed" for change in found)
    assert len(before) - went + came == len(new.items)
    if not updates:
        assert {change.kind for change in found} <= {"kept"}


def test_a_killed_run_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", result=False)
    lines = (folder / "transcript.jsonl").read_text().splitlines()
    (folder / "transcript.jsonl").unlink()
    kept = [*lines[:20], lines[20][: len(lines[20]) // 2]]
    (folder / "transcript.jsonl.partial").write_text("\n".join(kept))
    run = read_run(folder)
    assert run.task == TASK
    assert [step.n for step in run.steps] == [1, 2]
    assert run.counts.language_calls >= 2
    told = " ".join(run.problems)
    assert "The run did not end" in told
    assert "line 21: not JSON, or cut off" in told
    assert "result.json is missing" in told


def test_broken_and_foreign_lines_are_left_out_and_told(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run")
    path = folder / "transcript.jsonl"
    lines = path.read_text().splitlines()
    foreign = {"t": 1.0, "decision": 1, "system": "mine", "event": "thought", "data": {"n": 1}}
    wrong = json.loads(next(line for line in lines if '"goal_selector"' in line))
    wrong["data"]["p_WG"] = "there"
    extra = [json.dumps(foreign), json.dumps(wrong), "[1, 2]", '{"t": 1.0}', "\x00", "{}"]
    path.write_text("\n".join([*lines, *extra]))
    run = read_run(folder)
    assert len(run.steps) == 6
    first = len(lines) + 2
    assert f"line {first}: p_WG" in run.problems[0]
    assert f"line {first + 1}: not a line of a transcript" in run.problems[1]
    assert "the key 'system' is missing" in run.problems[2]
    assert "2 more lines" in run.problems[3]


def test_what_is_no_run_folder_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    empty = tmp_path / "empty"
    empty.mkdir()
    noise = tmp_path / "noise"
    noise.mkdir()
    (noise / "transcript.jsonl").write_bytes(b"\xff\xfe\x00\nno\n")
    for folder, fragment in (
        (tmp_path / "none", "does not exist"),
        (file, "is a file"),
        (empty, "holds neither transcript.jsonl"),
        (noise, "none of its 2 lines"),
    ):
        with pytest.raises(InputError, match=fragment):
            read_run(folder)


def test_line_ends_inside_a_text_do_not_end_its_line(tmp_path: Path) -> None:
    words = "a\u2028b\u2029c\u0085d"
    reply = MllmReply(n=1, text=words)
    line = transcript_line(1.0, 1, "language_link", "model_reply", reply, {})
    (tmp_path / "transcript.jsonl").write_text(line + "\n", encoding="utf-8")
    transcript = read_transcript(tmp_path)
    assert transcript.problems == ()
    assert [entry.message.text for entry in transcript.entries] == [words]


def test_an_empty_transcript_has_no_steps(tmp_path: Path) -> None:
    (tmp_path / "transcript.jsonl").write_text("")
    assert read_run(tmp_path).steps == ()


def test_another_version_s_result_is_told(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", result=False)
    (folder / "result.json").write_text('{"schema_version": 99}')
    run = read_run(folder)
    assert run.result is None
    assert "schema_version 99" in run.problems[0]
