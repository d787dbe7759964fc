from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from unilavira_drake.errors import InputError
from unilavira_drake.messages import Frame, LanguageAction, Panorama
from unilavira_drake.messages.metrics import EpisodeMetrics
from unilavira_drake.mllm.ledger import read_ledger
from unilavira_drake.mllm.reply import Attempt, MllmReply
from unilavira_drake.mllm.request import MllmRequest
from unilavira_drake.recording.run_folder import RunFolder, fresh_folder

JPEG = b"\xff\xd8\xff picture"


def names(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_the_transcript_grows_live_and_gets_its_name_at_the_end(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "a" / "run") as folder:
        folder.record(1.0, "language", "language_action", LanguageAction(n=4))
        partial = folder.path / "transcript.jsonl.partial"
        assert names(folder.path) == {partial.name, "ledger.jsonl"}
        assert json.loads(partial.read_text())["decision"] == 4
        folder.record(2.0, "episode_monitor", "metrics", EpisodeMetrics())
    lines = [
        json.loads(line) for line in (folder.path / "transcript.jsonl").read_text().splitlines()
    ]
    assert [line["decision"] for line in lines] == [4, 4]
    assert names(folder.path) == {"transcript.jsonl", "ledger.jsonl"}
    folder.close()


def test_what_was_done_is_kept_after_an_interrupt(tmp_path: Path) -> None:
    def interrupted_run() -> None:
        with RunFolder(tmp_path) as folder:
            folder.record(1.0, "language", "language_action", LanguageAction(n=1))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted_run()
    assert len((tmp_path / "transcript.jsonl").read_text().splitlines()) == 1


def test_a_picture_is_kept_once_under_its_hash(tmp_path: Path) -> None:
    panorama = Panorama(n=1, frames=(Frame(jpeg=JPEG), Frame(view="left", jpeg=JPEG)))
    with RunFolder(tmp_path) as folder:
        folder.record(1.0, "observer", "panorama", panorama)
        folder.record(2.0, "observer", "panorama", panorama)
    digest = hashlib.sha256(JPEG).hexdigest()
    assert names(tmp_path) == {"transcript.jsonl", "ledger.jsonl", f"frames/{digest}.jpg"}
    assert (tmp_path / "frames" / f"{digest}.jpg").read_bytes() == JPEG


def test_half_a_surrogate_pair_is_written_as_its_escape(tmp_path: Path) -> None:
    with RunFolder(tmp_path) as folder:
        folder.record(1.0, "language_link", "model_reply", MllmReply(n=1, text="a \ud800 ü"))
    line = json.loads((tmp_path / "transcript.jsonl").read_text())
    assert line["data"]["text"] == "a \ud800 ü"


def test_attempts_stand_in_the_ledger_as_they_end(tmp_path: Path) -> None:
    with RunFolder(tmp_path) as folder:
        folder.record_attempt(MllmRequest(n=1, call="decide"), 1, Attempt("m", latency=2.5))
        (row,) = read_ledger(tmp_path / "ledger.jsonl")
    assert (row.n, row.call, row.latency_s) == (1, "decide", 2.5)


def test_a_file_is_replaced_in_one_step(tmp_path: Path) -> None:
    with RunFolder(tmp_path) as folder:
        folder.write("result.json", "old")
        folder.write("result.json", b"new")
    assert (tmp_path / "result.json").read_bytes() == b"new"
    assert names(tmp_path) == {"result.json", "transcript.jsonl", "ledger.jsonl"}


def test_a_folder_in_use_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    with pytest.raises(InputError, match=r"not empty.*mine\.txt"):
        RunFolder(tmp_path)
    assert names(tmp_path) == {"mine.txt"}


def test_a_folder_that_cannot_be_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="cannot be used"):
            RunFolder(path)
    with pytest.raises(InputError, match="cannot be used"):
        fresh_folder(tmp_path / "file", "run")


def test_fresh_folders_are_numbered(tmp_path: Path) -> None:
    made = [fresh_folder(tmp_path / "runs", "flat").name for _ in range(3)]
    assert made == ["flat-1", "flat-2", "flat-3"]
