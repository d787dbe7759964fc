"""What the prompts say of stairs that the robot cannot take.

After a deliberate change of the templates: python tests/mllm/test_prompt_at_stairs.py
"""

from __future__ import annotations

import dataclasses

import pytest
from test_prompt import DECIDE, GOLDEN, _text, _with

FOLDER = GOLDEN / "stairs"
BARRED = _with(DECIDE, stairs_barred=True)
GOLDENS = {
    "decide": BARRED,
    "double_check": dataclasses.replace(BARRED, call="double_check"),
}


@pytest.mark.parametrize("name", GOLDENS)
def test_golden(name: str) -> None:
    assert _text(GOLDENS[name]) == (FOLDER / f"{name}.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("in_flight", [False, True])
@pytest.mark.parametrize("call", ["decide", "double_check"])
def test_they_are_told_of_beside_nothing_else(call: str, in_flight: bool) -> None:
    request = _with(dataclasses.replace(DECIDE, call=call), in_flight=in_flight)
    without = _text(request).splitlines()
    told = _text(_with(request, stairs_barred=True)).splitlines()
    added = [line for line in told if line not in without]
    assert added[0].startswith("- There are stairs here, but this robot cannot take them: ")
    assert "call double_check" in added[2]
    assert any("confirm" in line for line in added) == (call == "double_check")
    assert [line for line in told if line not in added] == without
    assert len(told) == len(without) + len(added)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, request in GOLDENS.items():
        (FOLDER / f"{name}.txt").write_text(_text(request), encoding="utf-8")
