"""Profiles: the shipped ones load, wrong ones are told what is wrong; prices and estimates."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from unilavira_drake.errors import ScenarioError
from unilavira_drake.mllm.address import is_loopback
from unilavira_drake.mllm.boxes import BOX_SPACES
from unilavira_drake.mllm.prices import cost_usd
from unilavira_drake.mllm.profile import ImageTokens, Prices, Profile, RoleSettings
from unilavira_drake.mllm.profiles import TEMPLATE, load_profile, profile_names
from unilavira_drake.mllm.prompt import Prompt
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.request import ImagePart
from unilavira_drake.mllm.tokens import estimated_tokens, jpeg_size, picture_tokens, text_tokens
from unilavira_drake.resources import models_path

SHIPPED = ("gemini-3.1-pro", "local-27b", "local-9b", "qwen3.5-27b", "served-rules")
GOOD = {"description": "d", "dialect": "openai", "base_url": "http://h/v1", "model": "m"}


def test_what_comes_with_the_library() -> None:
    assert profile_names() == SHIPPED


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_profiles_load(name: str) -> None:
    profile = load_profile(name)
    assert profile.name == name
    assert profile.box_space in BOX_SPACES
    for settings in (profile.language, profile.vision):
        assert settings.attempt_deadline < settings.deadline
    assert profile.prices is None or profile.prices.date.startswith("2026-")
    # Ground truth stays on this machine.
    assert (profile.peer == "rules") == (name == "served-rules")
    assert profile.peer == "model" or is_loopback(profile.base_url)


def test_the_template_loads_and_explains_every_field() -> None:
    path = models_path() / "mllm" / f"{TEMPLATE}.yaml"
    assert load_profile(str(path)).name == "my-model"
    given = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert set(given) == set(Profile.model_fields)
    assert set(given["language"]) == set(given["vision"]) == set(RoleSettings.model_fields)
    assert set(given["prices"]) == set(Prices.model_fields)
    defaults = Profile(**GOOD, name="x").model_dump()
    assert {key: given[key] for key in ("structured", "body", "reask_temperature", "language")} == {
        key: defaults[key] for key in ("structured", "body", "reask_temperature", "language")
    }
    assert given["vision"] == defaults["vision"]


def test_a_spec_without_a_file() -> None:
    profile = load_profile("openai:@cf/qwen@3.5@https://host:8443/v1")
    assert (profile.dialect, profile.model) == ("openai", "@cf/qwen@3.5")
    assert profile.base_url == "https://host:8443/v1"
    assert (profile.peer, profile.prices) == ("model", None)


@pytest.mark.parametrize(
    ("model", "space"),
    [
        ("qwen3.5-9b", "xyxy_1000"),
        ("Qwen/Qwen2.5-VL-7B-Instruct", "xyxy_resized"),
        ("google/gemini-3.1-pro-preview", "yxyx_1000"),
    ],
)
def test_a_family_is_known_by_its_name(model: str, space: str) -> None:
    assert load_profile(f"openai:{model}@http://localhost:1/v1").box_space == space


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("gemini-3.1", "did you mean 'gemini-3.1-pro'"),
        (TEMPLATE, "unknown profile 'template'"),
        ("openai:qwen3.5-9b", "must be openai:MODEL@BASE_URL"),
        ("openai:@http://h/v1", "must be openai:MODEL@BASE_URL"),
        ("openai:m@ftp://h/v1", "http:// or https://"),
        ("openai:m@http://", "must be openai:MODEL@BASE_URL"),
        ("openai:m@http:///v1", "is no address"),
        ("openai:m@http://h:99999/v1", "is no address"),
        ("openai:m@https://u:hunter2@h/v1", "may not hold a name or password"),
        ("openai:m@u:hunter2@h", "must be openai:MODEL@BASE_URL"),
        ("openai:m@https://h/v1?key=hunter2", "keys come from the environment"),
        ("nowhere.yaml", "cannot be read (No such file or directory)"),
    ],
)
def test_wrong_specs(spec: str, words: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_profile(spec, place="language_model")
    assert str(caught.value).startswith("language_model: ")
    assert words in str(caught.value)
    assert "u:hunter2@" not in str(caught.value).replace("m@u:hunter2@h", "")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"modell": "m"}, "unknown field 'modell'; did you mean 'model'"),
        ({"language": {"tempreature": 1}}, "did you mean 'temperature'"),
        ({"model": None}, "model: input should be a valid string"),
        ({"model": " "}, "model is empty"),
        ({"dialect": "gemni"}, "dialect: input should be 'gemini' or 'openai'"),
        ({"box_space": "xyxy_100"}, "did you mean 'xyxy_1000'"),
        ({"base_url": "h/v1"}, "base_url: 'h/v1' is no address"),
        ({"base_url": "https://u:pw@h"}, "may not hold a name or password"),
        ({"image_tokens": {"low": 1, "square": 28}}, "either low, medium and high, or square"),
        ({"image_tokens": {"low": 1}}, "either low, medium and high, or square"),
        ({"image_tokens": {}}, "either low, medium and high, or square"),
        ({"peer": "rules"}, "base_url must be a loopback address"),
        ({"body": {"messages": []}}, "body may not set messages"),
        ({"body": {"x": float("nan")}}, "body holds a value that JSON cannot write"),
        ({"prices": {"input": 1, "output": 2}}, "prices.date is missing"),
        ({"max_attempts": 0}, "max_attempts: "),
    ],
)
def test_wrong_files(tmp_path: Path, change: dict[str, object], words: str) -> None:
    path = tmp_path / "my.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **change}), encoding="utf-8")
    with pytest.raises(ScenarioError, match=r"my\.yaml") as caught:
        load_profile(str(path))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [("a: [", "line 2: no YAML"), ("- a\n", "a profile is a list"), ("\xff", "not UTF-8")],
)
def test_files_that_are_none(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "my.yaml"
    path.write_bytes((text + "\n").encode("latin-1"))
    with pytest.raises(ScenarioError, match=words):
        load_profile(str(path))


def test_a_file_is_named_after_itself_and_a_day_may_be_a_date(tmp_path: Path) -> None:
    path = tmp_path / "my.yml"
    path.write_text(
        yaml.safe_dump(GOOD) + "prices: {input: 1, output: 2, date: 2026-11-03}\n",
        encoding="utf-8",
    )
    profile = load_profile(str(path))
    assert profile.name == "my"
    assert profile.prices is not None
    assert profile.prices.date == "2026-11-03"


def test_the_papers_call_costs_what_it_costs() -> None:
    prices = load_profile("gemini-3.1-pro").prices
    assert cost_usd(Usage(22305, 1618), prices) == pytest.approx(0.0640, abs=5e-5)
    assert cost_usd(Usage(22305, 1618, cached_tokens=16000), prices) == pytest.approx(
        0.0352, abs=5e-5
    )


def test_unknown_costs_are_none() -> None:
    prices = Prices(input=2.0, output=8.0, date="2026-11")
    assert cost_usd(Usage(1000, 100), None) is None
    assert cost_usd(Usage(), prices) is None
    assert cost_usd(Usage(1000, 100, cached_tokens=500), prices) == pytest.approx(0.0028)


def jpeg(width: int, height: int) -> bytes:
    done, data = cv2.imencode(".jpg", np.zeros((height, width, 3), np.uint8))
    assert done
    return data.tobytes()


@pytest.mark.parametrize(("width", "height"), [(640, 480), (17, 300), (1, 1)])
def test_the_size_of_a_picture(width: int, height: int) -> None:
    assert jpeg_size(jpeg(width, height)) == (width, height)


@pytest.mark.parametrize(
    "data", [b"", b"\xff\xd8", b"GIF89a" * 9, b"\xff\xd8\xff\xe0\x00\x00" + b"\xff" * 40]
)
def test_what_is_no_picture_has_no_size(data: bytes) -> None:
    assert jpeg_size(data) is None


def test_every_cut_of_a_picture_is_read_safely() -> None:
    data = jpeg(64, 48)
    assert {jpeg_size(data[:n]) for n in range(len(data))} <= {None, (64, 48)}


def test_pictures_by_each_rule() -> None:
    gemini, qwen = load_profile("gemini-3.1-pro"), load_profile("qwen3.5-27b")
    view, past = ImagePart("view", jpeg(640, 480), "medium"), ImagePart("H1", jpeg(320, 240), "low")
    assert picture_tokens(view, gemini.image_tokens) == 560
    assert picture_tokens(past, gemini.image_tokens) == 280
    assert picture_tokens(view, qwen.image_tokens) == 300
    assert picture_tokens(past, qwen.image_tokens) == 80
    assert picture_tokens(ImagePart("x", b"none"), ImageTokens(square=28)) == 23 * 17
    assert picture_tokens(view, None) == 23 * 17
    prompt = Prompt("abcd", ("efg", view, past))
    assert estimated_tokens(prompt, gemini) == 2 + 560 + 280
    assert text_tokens("") == 0
