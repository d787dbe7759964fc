"""The mailbox: what a reader finds there, and when a reply counts."""

from __future__ import annotations

import dataclasses
import json
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from unilavira_drake.errors import MllmError, MllmRequestError, MllmTimeout, ScenarioError
from unilavira_drake.mllm.mailbox import MailboxModel
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.request import ImagePart, LanguageVariables, MllmRequest, ViewNote

REQUEST = MllmRequest(
    n=2,
    call="decide",
    variables=LanguageVariables(task="Go to the sofa.", views=(ViewNote("front", 2.0),)),
    images=(ImagePart("view front", b"\xff\xd8 one"),),
)
PLACE = "002-language-decide"
REPLY = '{"action": {"tool": "turn", "direction": "front"}}'


def answer(folder: Path, write: Callable[[Path], None]) -> threading.Thread:
    """Starts a reader that answers as soon as the request is there."""

    def wait() -> None:
        until = time.monotonic() + 10.0
        while not (folder / PLACE).exists() and time.monotonic() < until:
            time.sleep(0.005)
        write(folder / PLACE)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    return thread


def test_a_request_becomes_a_folder_and_its_reply_is_read(tmp_path: Path) -> None:
    folder = tmp_path / "mail"
    seen: dict[str, bytes] = {}

    def write(place: Path) -> None:
        seen.update({path.name: path.read_bytes() for path in place.iterdir()})
        (place / ".reply.json").write_text(REPLY)
        os.replace(place / ".reply.json", place / "reply.json")

    model = MailboxModel(folder)
    assert not folder.exists()
    thread = answer(folder, write)
    completion = model.complete(REQUEST)
    thread.join()
    assert completion.text == REPLY
    assert completion.usage.images == 1
    assert completion.usage.cost_usd is None
    # It appeared there whole.
    assert set(seen) == {"prompt.txt", "01-view-front.jpg", "request.json"}
    assert seen["prompt.txt"].decode() == compose_prompt(REQUEST).text
    assert seen["01-view-front.jpg"] == b"\xff\xd8 one"
    about = json.loads(seen["request.json"])
    assert (about["role"], about["call"], about["n"], about["attempt"]) == (
        "language", "decide", 2, 0,
    )  # fmt: skip
    assert about["pictures"] == [{"file": "01-view-front.jpg", "label": "view front"}]
    assert about["reply_schema"]["properties"]["action"]
    assert [path.name for path in folder.iterdir()] == [PLACE]


@pytest.mark.parametrize("name", ["reply.json", "reply.txt"])
def test_a_slow_writer_is_waited_for(tmp_path: Path, name: str) -> None:
    def write(place: Path) -> None:
        with (place / name).open("w") as stream:
            for part in (REPLY[:10], REPLY[10:20], REPLY[20:]):
                stream.write(part)
                stream.flush()
                time.sleep(0.25)

    thread = answer(tmp_path, write)
    assert MailboxModel(tmp_path).complete(REQUEST).text == REPLY
    thread.join()


def test_a_reply_that_is_no_json_is_given_when_it_stays_the_same(tmp_path: Path) -> None:
    answer(tmp_path, lambda place: bool((place / "reply.txt").write_text("Go left!")) or None)
    assert MailboxModel(tmp_path).complete(REQUEST).text == "Go left!"


def test_what_was_answered_before_is_found_again(tmp_path: Path) -> None:
    answer(tmp_path, lambda place: bool((place / "reply.json").write_text(REPLY)) or None)
    MailboxModel(tmp_path).complete(REQUEST)
    before = sorted(path.stat().st_mtime_ns for path in tmp_path.rglob("*"))
    assert MailboxModel(tmp_path).complete(REQUEST).text == REPLY
    assert sorted(path.stat().st_mtime_ns for path in tmp_path.rglob("*")) == before
    other = dataclasses.replace(REQUEST, variables=LanguageVariables(task="Go to the bed."))
    with pytest.raises(MllmRequestError, match="another request"):
        MailboxModel(tmp_path).complete(other)


def test_what_a_killed_run_left_half_written_is_written_anew(tmp_path: Path) -> None:
    (tmp_path / f".{PLACE}.partial").mkdir()
    (tmp_path / f".{PLACE}.partial" / "old.jpg").write_bytes(b"")
    answer(tmp_path, lambda place: bool((place / "reply.json").write_text(REPLY)) or None)
    MailboxModel(tmp_path).complete(REQUEST)
    assert not (tmp_path / PLACE / "old.jpg").exists()


def test_a_re_ask_has_a_folder_of_its_own(tmp_path: Path) -> None:
    model = MailboxModel(tmp_path)
    names = [model.place(dataclasses.replace(REQUEST, attempt=a)).name for a in (0, 1, 2)]
    assert names == [PLACE, f"{PLACE}-again", f"{PLACE}-again2"]


def test_silence_is_a_timeout_that_names_the_folder(tmp_path: Path) -> None:
    (tmp_path / "mailbox.yaml").write_text("timeout_s: 0.05")
    with pytest.raises(MllmTimeout, match=PLACE):
        MailboxModel(tmp_path).complete(REQUEST)


def test_closing_ends_the_waiting(tmp_path: Path) -> None:
    model = MailboxModel(tmp_path)
    answer(tmp_path, lambda place: model.close())
    began = time.monotonic()
    with pytest.raises(MllmError, match="closed"):
        model.complete(REQUEST)
    assert time.monotonic() - began < 5.0


def test_the_mailbox_says_who_answers(tmp_path: Path) -> None:
    plain = MailboxModel(tmp_path)
    assert (plain.name, plain.perception, plain.reasoning) == ("mailbox", "images", "human")
    assert (plain.box_space, plain.deadline) == ("pixels", 3600.0)
    (tmp_path / "mailbox.yaml").write_text(
        "answered_by: A. Reader\nreasoning: model\ntimeout_s: 60\nbox_space: xyxy_1000\n"
    )
    model = MailboxModel(tmp_path)
    assert (model.answered_by, model.reasoning) == ("A. Reader", "model")
    assert (model.box_space, model.deadline) == ("xyxy_1000", 60.0)
    assert "A. Reader" in model.description


@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        ("timeout: 3", "timeout_s"),
        ("reasoning: alien", "reasoning"),
        ("timeout_s: -1", "timeout_s"),
        ("box_space: inches", "xyxy_1000"),
        ("[", "cannot be read"),
        ("- 1", r"mailbox\.yaml"),
    ],
)
def test_a_wrong_setting_is_told(tmp_path: Path, text: str, fragment: str) -> None:
    (tmp_path / "mailbox.yaml").write_text(text)
    with pytest.raises(ScenarioError, match=fragment):
        MailboxModel(tmp_path)


def test_a_file_is_no_mailbox(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(ScenarioError, match="folder"):
            MailboxModel(path)
