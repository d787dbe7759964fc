"""From a SPEC to a model."""

from __future__ import annotations

from pathlib import Path

import pytest

from unilavira_drake.errors import ScenarioError
from unilavira_drake.mllm.backends import make_backend, profile_of
from unilavira_drake.mllm.mailbox import MailboxModel
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.reply import Mllm


def made(spec: str) -> Mllm:
    return make_backend(spec, role="vision", place="vision_model")


def test_a_profile_a_file_and_an_address_are_remote_models(tmp_path: Path) -> None:
    own = tmp_path / "mine.yaml"
    own.write_text(
        "description: My server\ndialect: openai\nbase_url: http://127.0.0.1:9/v1\nmodel: m\n"
    )
    for spec, name in (
        ("gemini-3.1-pro", "gemini-3.1-pro"),
        (str(own), "mine"),
        ("openai:m@http://127.0.0.1:9/v1", "openai:m"),
    ):
        model = made(spec)
        assert isinstance(model, RemoteModel)
        assert model.name == name
        assert (model.perception, model.reasoning) == ("images", "model")
        assert profile_of(spec, place="here") is not None


def test_making_a_model_leaves_nothing_behind(tmp_path: Path) -> None:
    model = made(f"mailbox:{tmp_path / 'mail'}")
    assert isinstance(model, MailboxModel)
    made("openai:m@http://127.0.0.1:9/v1").close()
    assert not list(tmp_path.iterdir())
    assert profile_of("rules", place="here") is None


@pytest.mark.parametrize(
    ("spec", "fragments"),
    [
        ("gemini-3.1", ["'gemini-3.1-pro'", "cassette:FILE", "mailbox:DIR", "local-9b"]),
        ("cassette", ["cassette:FILE"]),
        ("cassette:", ["cassette:FILE"]),
        ("mailbox:", ["mailbox:DIR"]),
        ("cassette:none.jsonl", ["none.jsonl", "no such file"]),
        ("openai:m", ["openai:MODEL@BASE_URL"]),
        ("none.yaml", ["none.yaml"]),
    ],
)
def test_a_spec_that_cannot_be_used_is_told_with_its_place(spec: str, fragments: list[str]) -> None:
    with pytest.raises(ScenarioError) as error:
        made(spec)
    for fragment in ("vision_model", *fragments):
        assert fragment in str(error.value)


def test_a_cassette_of_the_package_is_named_without_its_folder() -> None:
    model = make_backend("cassette:apartment_fridge", role="language", place="m")
    assert model.reasoning == "model"
    with pytest.raises(ScenarioError, match="did you mean 'apartment_fridge'"):
        make_backend("cassette:apartment_frige", role="language", place="m")
