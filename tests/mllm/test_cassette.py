"""Cassettes: what is recorded comes back, and what differs is told."""

from __future__ import annotations

import dataclasses
import json
import threading
from pathlib import Path
from typing import Any

import pytest

from unilavira_drake.errors import (
    CassetteError,
    MllmUnreachable,
    ReplyFormatError,
    ReplyRefused,
    ReplyTruncated,
    ScenarioError,
)
from unilavira_drake.mllm.cassette import CassetteHeader
from unilavira_drake.mllm.cassette_file import CassetteWriter, read_header, read_replies
from unilavira_drake.mllm.replay import CassetteModel, RecordingModel, declared
from unilavira_drake.mllm.reply import Attempt, Completion, Usage
from unilavira_drake.mllm.request import FreeVariables, ImagePart, MllmRequest

USAGE = Usage(1200, 80, 1, 0.0125, 300, 40)


class Model:
    """Answers with the request's number; every third call fails in a way of its own."""

    name = "test-model"
    perception = "images"
    reasoning = "model"
    box_space = "yxyx_1000"
    description = "A test's own model."
    deadline = 10.0
    answered_by = "A. Reader"

    def __init__(self, error: Exception | None = None, latency: float | None = 31.25) -> None:
        self.calls = 0
        self.closed = False
        self._error = error
        self._latency = latency

    def complete(self, request: MllmRequest) -> Completion:
        self.calls += 1
        if self._error is not None:
            raise self._error
        return Completion(f"reply {request.n} \ud800 ü", USAGE, self._latency)

    def close(self) -> None:
        self.closed = True


def request(n: int, text: str = "Free floor 2.3 m.", **changes: object) -> MllmRequest:
    plain = MllmRequest(
        n=n,
        call="free",
        seed=4,
        variables=FreeVariables(text),
        images=(ImagePart("view", b"\xff\xd8 no picture"),),
    )
    return dataclasses.replace(plain, **changes)  # type: ignore[arg-type]


def header(model: Model) -> CassetteHeader:
    return CassetteHeader(
        answered_by="A. Reader",
        date="2026-11-22",
        preset="compact",
        language=declared(model),
        vision=declared(model),
    )


def recording(path: Path, model: Model, mode: str = "record") -> RecordingModel:
    return RecordingModel(model, CassetteWriter(path, header=header(model), mode=mode))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "deep" / "c.jsonl"


def test_what_is_recorded_comes_back(path: Path) -> None:
    model = Model()
    recorder = recording(path, model)
    assert not path.exists()
    first = recorder.complete(request(1))
    vision = recorder.complete(request(1, role="vision"))
    again = recorder.complete(request(1, attempt=1))
    recorder.close()
    assert model.closed
    for role, asked, completion in (
        ("language", request(1), first),
        ("vision", request(1, role="vision"), vision),
        ("language", request(1, attempt=1), again),
    ):
        replayed = CassetteModel(path, role=role).complete(asked)
        assert (replayed.text, replayed.usage, replayed.latency) == (
            completion.text, USAGE, 31.25,
        )  # fmt: skip
        assert [attempt.status for attempt in replayed.attempts] == ["replayed"]


def test_a_cassette_declares_what_was_recorded(path: Path) -> None:
    recording(path, Model()).complete(request(1))
    cassette = CassetteModel(path, role="vision")
    assert cassette.name == "cassette (test-model)"
    assert (cassette.perception, cassette.reasoning) == ("images", "model")
    assert cassette.box_space == "yxyx_1000"
    assert "A. Reader" in cassette.description
    assert "2026-11-22" in cassette.description
    cassette.close()


def test_a_latency_that_the_model_does_not_tell_is_measured_once(path: Path) -> None:
    completion = recording(path, Model(latency=None)).complete(request(1))
    assert completion.latency is not None
    assert CassetteModel(path, role="language").complete(request(1)).latency == completion.latency


@pytest.mark.parametrize("kind", [ReplyRefused, ReplyTruncated, ReplyFormatError])
def test_the_model_s_own_errors_are_recorded(path: Path, kind: type[ReplyFormatError]) -> None:
    error = kind("blocked: by a filter")
    error.attempts = (Attempt("m", usage=USAGE), Attempt("m", usage=USAGE))
    with pytest.raises(kind) as live:
        recording(path, Model(error)).complete(request(1))
    with pytest.raises(kind, match="blocked: by a filter") as replayed:
        CassetteModel(path, role="language").complete(request(1))
    assert type(replayed.value) is kind
    assert replayed.value.latency == live.value.latency
    (attempt,) = replayed.value.attempts
    assert attempt.usage == USAGE + USAGE


def test_errors_of_the_service_are_not(path: Path) -> None:
    with pytest.raises(MllmUnreachable):
        recording(path, Model(MllmUnreachable("refused"))).complete(request(1))
    assert not path.exists()


def test_a_miss_names_the_nearest(path: Path) -> None:
    recorder = recording(path, Model())
    for n in range(1, 9):
        recorder.complete(request(n))
    with pytest.raises(CassetteError) as error:
        CassetteModel(path, role="language").complete(request(9))
    told = str(error.value)
    assert "no reply to language call 9, attempt 0, seed 4 (free)" in told
    assert "nearest of its 8: language call 8, attempt 0, seed 4 (free)" in told
    with pytest.raises(CassetteError, match="seed 5"):
        CassetteModel(path, role="language").complete(request(1, seed=5))


def test_a_difference_is_told(path: Path) -> None:
    recording(path, Model()).complete(request(1))
    cassette = CassetteModel(path, role="language")
    assert cassette.complete(request(1, "Free floor 2.4 m.")).text.startswith("reply 1")
    with pytest.raises(CassetteError, match=r"c\.jsonl.*call 1.*was .*2\.3 m.*is now .*3\.3 m"):
        cassette.complete(request(1, "Free floor 3.3 m."))
    with pytest.raises(CassetteError, match=r"picture 1 \('view'\)"):
        cassette.complete(request(1, images=(ImagePart("view", b"\xff\xd8 another"),)))
    with pytest.raises(CassetteError, match="line"):
        cassette.complete(request(1, images=()))


def test_an_existing_file_is_refused_and_continued(path: Path) -> None:
    model = Model()
    recording(path, model).complete(request(1))
    with pytest.raises(ScenarioError, match=r"exists.*record_new"):
        recording(path, model)
    with path.open("ab") as stream:
        stream.write(b'{"role": "language", "n": 2, "tor')
    assert read_replies(path).find(request(2)) is None
    recorder = recording(path, model, "record_new")
    assert recorder.complete(request(1)).text.startswith("reply 1")
    assert model.calls == 1
    recorder.complete(request(2))
    assert model.calls == 2
    assert len(path.read_bytes().splitlines()) == 3
    assert read_replies(path).find(request(2)) is not None
    with pytest.raises(CassetteError, match="not the recorded one"):
        recorder.complete(request(2, "Another text."))


def test_record_new_makes_the_file_as_well(path: Path) -> None:
    recording(path, Model(), "record_new").complete(request(1))
    assert read_header(path).answered_by == "A. Reader"


def test_both_roles_write_to_one_file_at_once(path: Path) -> None:
    model = Model()
    writer = CassetteWriter(path, header=header(model))
    models = {role: RecordingModel(model, writer) for role in ("language", "vision")}

    def ask(role: str) -> None:
        for n in range(1, 21):
            models[role].complete(request(n, role=role))

    threads = [threading.Thread(target=ask, args=(role,)) for role in models]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    lines = [json.loads(line) for line in path.read_bytes().splitlines()]
    assert lines[0]["cassette"] == 1
    assert len(lines) == 41


@pytest.mark.parametrize("text", ["", "{}\n", "no json\n", "[1]\n", '{"cassette": 1}\n'])
def test_another_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "c.jsonl"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=r"c\.jsonl"):
        CassetteModel(path, role="language")
    with pytest.raises(ScenarioError):
        recording(path, Model(), "record_new")


def test_a_newer_version_and_a_broken_line_are_told(path: Path) -> None:
    recording(path, Model()).complete(request(1))
    lines = path.read_text().splitlines()
    broken = path.with_name("broken.jsonl")
    broken.write_text("\n".join([lines[0], '{"role": "language"}', lines[1], ""]))
    with pytest.raises(CassetteError, match="line 2"):
        CassetteModel(broken, role="language").complete(request(1))
    broken.write_text(lines[0].replace('"cassette": 1', '"cassette": 2') + "\n")
    with pytest.raises(ScenarioError, match="version is 2"):
        read_header(broken)


def test_a_cassette_holds_no_path(path: Path) -> None:
    recording(path, Model()).complete(request(1))
    assert str(path.parent) not in path.read_text()


def test_a_file_that_cannot_be_written_is_told_before_a_call(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ScenarioError, match="cannot be written"):
        recording(tmp_path / "file" / "c.jsonl", Model())
    with pytest.raises(ScenarioError):
        recording(tmp_path, Model(), "record_new")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"language": {"name": "other"}}, r"language rules.*this is other"),
        ({"vision": {"perception": "images"}}, r"vision .*\(images\)"),
        ({"preset": "paper"}, r"preset compact, this is paper"),
    ],
)
def test_a_cassette_is_continued_by_the_models_that_began_it(
    path: Path, change: dict[str, Any], told: str
) -> None:
    recording(path, Model(), "record").complete(request(1))
    old = header(Model())
    known = {"language": {"name": "rules"}, "vision": {"perception": "ground_truth"}}
    begun = {part: getattr(old, part).model_copy(update=update) for part, update in known.items()}
    new = {
        part: update if isinstance(update, str) else begun[part].model_copy(update=update)
        for part, update in change.items()
    }
    other = path.with_name("begun.jsonl")
    writer = CassetteWriter(other, header=old.model_copy(update=begun))
    RecordingModel(Model(), writer).complete(request(1))
    with pytest.raises(ScenarioError, match=told):
        CassetteWriter(other, header=old.model_copy(update={**begun, **new}), mode="record_new")
