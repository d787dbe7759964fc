from __future__ import annotations

import pytest

from unilavira_drake.errors import MllmAuthenticationError
from unilavira_drake.mllm.address import host_of, is_loopback
from unilavira_drake.mllm.keys import find_key, plain_line, redact

FAR = "https://api.example.org/v1"
PLAIN = "http://192.168.1.20:8080/v1"
LOOPBACK = "http://127.0.0.1:8080/v1"
SHARED = {"UNILAVIRA_API_KEY": "shared-key-1"}
OWN = {"UNILAVIRA_VISION_API_KEY": "vision-key-2"}


@pytest.mark.parametrize(
    ("role", "url", "environment", "found"),
    [
        ("language", FAR, SHARED, "shared-key-1"),
        ("vision", FAR, SHARED | OWN, "vision-key-2"),
        ("language", FAR, SHARED | OWN, "shared-key-1"),
        ("vision", FAR, {"UNILAVIRA_API_KEY": " padded-key \n"}, "padded-key"),
        ("vision", LOOPBACK, {}, None),
        ("vision", LOOPBACK, SHARED, "shared-key-1"),
        ("vision", PLAIN, {}, None),
        # An empty one of its own: the shared key is for the other model.
        ("vision", PLAIN, SHARED | {"UNILAVIRA_VISION_API_KEY": ""}, None),
        ("vision", FAR, {"UNILAVIRA_API_KEY": ""}, None),
    ],
)
def test_where_a_key_comes_from(
    role: str, url: str, environment: dict[str, str], found: str | None
) -> None:
    key = find_key(role, url, environment)
    assert (key.get_secret_value() if key else None) == found
    assert found is None or found not in f"{key} {key!r}"


@pytest.mark.parametrize(
    ("url", "environment", "said"),
    [
        (FAR, {}, "api.example.org needs a key: set UNILAVIRA_VISION_API_KEY or UNILAVIRA_API_KEY"),
        (PLAIN, SHARED, "not sent to 192.168.1.20:8080 over plain http"),
        (PLAIN, OWN, "UNILAVIRA_VISION_API_KEY: the key is not sent"),
        (FAR, {"UNILAVIRA_API_KEY": "two words"}, "no HTTP header can carry"),
        (FAR, {"UNILAVIRA_API_KEY": "schlüssel"}, "no HTTP header can carry"),
    ],
)
def test_a_key_that_is_missing_or_may_not_be_sent(
    url: str, environment: dict[str, str], said: str
) -> None:
    with pytest.raises(MllmAuthenticationError, match=said) as caught:
        find_key("vision", url, environment)
    assert not any(value in str(caught.value) for value in environment.values())


@pytest.mark.parametrize(
    ("url", "own"),
    [
        ("http://127.0.0.1:1", True),
        ("http://127.8.9.1", True),
        ("http://[::1]:8080/v1", True),
        ("http://LOCALHOST:1/", True),
        ("http://model.localhost", True),
        ("http://localhost.example.org", False),
        ("http://127.0.0.1.example.org", False),
        ("http://127.0.0.1@example.org", False),
        ("http://0.0.0.0:8080", False),
        ("http://192.168.1.20", False),
        ("http://[fe80::1]", False),
        ("no address", False),
    ],
)
def test_loopback(url: str, own: bool) -> None:
    assert is_loopback(url) == own


def test_a_host_is_named_without_what_may_be_secret() -> None:
    assert host_of("https://me:secret@api.example.org:8443/v1?key=secret") == "api.example.org:8443"


def test_a_key_is_taken_out_of_texts() -> None:
    key = find_key("vision", FAR, {"UNILAVIRA_API_KEY": "a+secret/key"})
    assert redact("Bearer a+secret/key, a%2Bsecret%2Fkey.", key) == "Bearer ***, ***."
    # A placeholder is no secret, and would take words out of every message.
    placeholder = find_key("vision", LOOPBACK, {"UNILAVIRA_API_KEY": "EMPTY"})
    assert redact("EMPTY body", placeholder) == "EMPTY body"


def test_what_a_server_says_becomes_one_short_line() -> None:
    assert plain_line("a\x1b[31m red\r\n\u2028 b\ud800", None) == "a [31m red b\\ud800"
    assert len(plain_line("x" * 1000, None)) == 400
