"""Benchmarks refuse names of which they have nothing to measure."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType

import pytest


@pytest.mark.parametrize(
    ("benchmark", "given", "words"),
    [
        ("robot_tasks", ("--only", "stairs"), "unknown group 'stairs'; did you mean 'storeys'?"),
        ("robots", ("--robots", "nonsense"), "unknown robot on the ground 'nonsense'; valid: "),
        ("robots", ("--robots", "quadrotor"), "valid: cobot_magic, unitree_g1, unitree_go1."),
        ("robots", ("--tasks", "fridge,bath"), "unknown task 'bath'; did you mean 'bathtub'?"),
        ("families", ("--tasks", "fridges"), "unknown task 'fridges'"),
        ("families", ("--wirings", "none"), "unknown wiring 'none'"),
        ("episode", ("--tasks", "nonsense"), "unknown task 'nonsense'; valid: bathtub, "),
    ],
)
def test_an_unknown_name_is_refused(
    benchmark_module: Callable[[str], ModuleType],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    benchmark: str,
    given: tuple[str, str],
    words: str,
) -> None:
    monkeypatch.setattr(sys, "argv", [f"{benchmark}.py", *given])
    with pytest.raises(SystemExit) as ended:
        benchmark_module(benchmark).main()
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


def test_names_are_a_list_with_commas(benchmark_module: Callable[[str], ModuleType]) -> None:
    names = benchmark_module("chosen").names_among("group", ("route", "town"))
    assert names("town, route,") == ["town", "route"]
    assert names("") == []
