"""A typed request survives its way as JSON, and travels to peers that declare ``rules`` only."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import pytest
from test_prompt import DECIDE, GROUND

from unilavira_drake.errors import InputError
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.gemini import GeminiDialect
from unilavira_drake.mllm.openai_compatible import OpenAiDialect
from unilavira_drake.mllm.profile import Profile
from unilavira_drake.mllm.profiles import load_profile, profile_names
from unilavira_drake.mllm.prompt import Prompt, compose_prompt
from unilavira_drake.mllm.request import FreeVariables, ImagePart, MllmRequest
from unilavira_drake.mllm.transfer import EXTRA_FIELD, request_from_json, request_to_json
from unilavira_drake.mllm.wire import WireDialect

EVIDENCE = (
    ViewEvidence(
        detections=(
            Detection("front#1", "zeppelin", "white", box=(1.0, 2.0, 3.5, 4.0), distance=math.inf),
        )
    ),
    ViewEvidence("left"),
)
REQUESTS = {
    "decide": dataclasses.replace(DECIDE, evidence=EVIDENCE, feedback="the key scene is missing"),
    "no_evidence": DECIDE,
    "ground": dataclasses.replace(GROUND, evidence=EVIDENCE[:1], seed=3, attempt=1),
    "free": MllmRequest(
        call="free",
        variables=FreeVariables("What is this?"),
        images=(ImagePart("picture", b"one", "low"), ImagePart("picture", b"two")),
    ),
}
DIALECTS: dict[str, WireDialect] = {"gemini": GeminiDialect(), "openai": OpenAiDialect()}


def bodies(request: MllmRequest, profile: Profile) -> dict[str, bytes]:
    """Returns the body of a request in both dialects, whatever the profile's own is."""
    prompt = compose_prompt(request)
    return {
        name: dialect.body(
            prompt,
            request,
            profile,
            structured=profile.structured,
            temperature=0.0,
            max_output_tokens=100,
        )
        for name, dialect in DIALECTS.items()
    }


@pytest.mark.parametrize("name", REQUESTS)
def test_round_trip(name: str) -> None:
    request = REQUESTS[name]
    prompt = compose_prompt(request)
    text = json.dumps(request_to_json(request, prompt), allow_nan=False)
    again = request_from_json(json.loads(text), [image.jpeg for image in prompt.images])
    assert again == request
    assert again.digest == request.digest


def test_pictures_travel_once() -> None:
    request = REQUESTS["free"]
    value = request_to_json(request, compose_prompt(request))
    assert [image["picture"] for image in value["images"]] == [0, 1]
    hidden = request_to_json(request, Prompt(parts=("Without pictures.",)))
    assert "picture" not in hidden["images"][0]
    assert request_from_json(hidden, []) == request


@pytest.mark.parametrize("name", profile_names())
def test_ground_truth_goes_to_peers_that_declare_rules_only(name: str) -> None:
    profile = load_profile(name)
    for request in REQUESTS.values():
        for body in bodies(request, profile).values():
            sent = EXTRA_FIELD.encode() in body
            assert sent == (profile.peer == "rules")
            assert (b"zeppelin" in body) == (sent and request.evidence is not None)


def test_an_ad_hoc_endpoint_is_never_sent_ground_truth() -> None:
    # Not even our own server under another address.
    profile = load_profile("openai:rules@http://127.0.0.1:8750/v1")
    for body in bodies(REQUESTS["decide"], profile).values():
        assert EXTRA_FIELD.encode() not in body
        assert b"zeppelin" not in body


GOOD = {**request_to_json(REQUESTS["decide"], Prompt()), "images": []}


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "must be an object"),
        ([], "must be an object"),
        ({}, "kind must be one of"),
        ({**GOOD, "kind": []}, "kind must be one of"),
        ({**GOOD, "variables": 3}, "variables"),
        ({**GOOD, "variables": {"views": [{"free_distance": "far"}]}}, "variables.views.0"),
        ({**GOOD, "n": "many"}, "request.n"),
        ({**GOOD, "evidence": 3}, "evidence"),
        ({**GOOD, "images": 3}, "images must be a list"),
        ({**GOOD, "images": [3]}, "each of images"),
        ({**GOOD, "images": [{"picture": 99}]}, "picture 99"),
        ({**GOOD, "images": [{"picture": -1}]}, "picture -1"),
        ({**GOOD, "images": [{"picture": True}]}, "picture must be a number"),
        ({**GOOD, "images": [{"jpeg": "?"}]}, "jpeg must be base64"),
        ({**GOOD, "images": [{}]}, "jpeg must be base64"),
    ],
)
def test_what_is_no_request_is_told(value: Any, words: str) -> None:
    with pytest.raises(InputError) as caught:
        request_from_json(value, [b"jpeg"])
    assert str(caught.value).startswith(EXTRA_FIELD)
    assert words in str(caught.value)
