from __future__ import annotations

import dataclasses
import hashlib
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unilavira_drake.messages import (
    Frame,
    Goal,
    History,
    Intrinsics,
    KeyPicture,
    LanguageAction,
    OccupancyMap,
    Panorama,
    TodoUpdate,
)
from unilavira_drake.recording.transcript import plain, transcript_line

JPEG = b"\xff\xd8\xff picture"
DIGEST = hashlib.sha256(JPEG).hexdigest()


def line(message: object, t: float = 1.0) -> dict[str, object]:
    read: dict[str, object] = json.loads(transcript_line(t, 3, "a", "b", message, {}))
    return read


def test_a_line_has_the_five_fields_in_order() -> None:
    action = LanguageAction(n=3, call="decide", todo_updates=(TodoUpdate(content="x"),))
    read = line(action, t=0.1 + 0.2)
    assert list(read) == ["t", "decision", "system", "event", "data"]
    assert (read["t"], read["decision"], read["system"], read["event"]) == (0.3, 3, "a", "b")
    assert read["data"]["todo_updates"][0]["content"] == "x"  # type: ignore[index]


def test_every_field_of_a_message_stands_there_sorted() -> None:
    data = line(LanguageAction())["data"]
    assert list(data) == sorted(field.name for field in dataclasses.fields(LanguageAction))  # type: ignore[call-overload]


def test_a_frame_is_its_jpeg_view_and_intrinsics() -> None:
    pictures: dict[str, bytes] = {}
    frame = Frame(view="left", color=np.ones((48, 64, 3), np.uint8), jpeg=JPEG)
    panorama = Panorama(n=1, frames=(frame, frame))
    (first, _) = plain(panorama, pictures)["frames"]
    assert set(first) == {"view", "time", "jpeg", "intrinsics", "X_WC"}
    assert (first["view"], first["jpeg"]) == ("left", DIGEST)
    assert Intrinsics(**first["intrinsics"]) == frame.intrinsics
    assert pictures == {DIGEST: JPEG}


def test_pictures_in_a_history_are_kept_and_other_bytes_are_not() -> None:
    pictures: dict[str, bytes] = {}
    kept = tuple(KeyPicture(jpeg=jpeg) for jpeg in (JPEG, b"no jpeg", b""))
    data = plain(History(n=1, keyframes=kept), pictures)
    digests = [picture["jpeg"] for picture in data["keyframes"]]
    assert digests == [DIGEST, hashlib.sha256(b"no jpeg").hexdigest(), ""]
    assert pictures == {DIGEST: JPEG}


def test_large_arrays_are_left_out_and_poses_are_not() -> None:
    data = plain(OccupancyMap(log_odds=np.zeros((5, 5), np.int8)), {})
    assert "log_odds" not in data
    assert data["origin"] == [0.0, 0.0]
    assert plain(Panorama(), {})["X_WB"] == np.eye(4).tolist()


def test_numbers_that_json_lacks_stand_as_text() -> None:
    data = line(Goal(p_WG=(math.inf, -math.inf, math.nan), heading=-1e-9))["data"]
    assert data["p_WG"] == ["inf", "-inf", "nan"]  # type: ignore[index]
    assert math.copysign(1.0, data["heading"]) == 1.0  # type: ignore[index]


def test_what_is_no_message_is_refused() -> None:
    with pytest.raises(TypeError, match="object"):
        plain(object(), {})


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.floats(), st.text(), st.none() | st.integers())
def test_any_message_makes_one_line_of_json(number: float, text: str, index: int | None) -> None:
    update = TodoUpdate(content=text, index=index)
    message = LanguageAction(n=1, reason=text, todo_updates=(update,))
    text_line = transcript_line(number, 1, "a", "b", message, {})
    assert "\n" not in text_line
    assert json.loads(text_line)["data"]["todo_updates"][0]["index"] == index
    assert text_line == transcript_line(number, 1, "a", "b", message, {})
