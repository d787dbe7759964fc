"""How the benchmarks tell the speed of a simulation from several runs of it."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest
from pydrake.systems.analysis import Simulator

from unilavira_drake import load_scenario, make_navigation_diagram
from unilavira_drake.raster.renderer import RasterRenderer


@pytest.fixture(scope="module")
def moving(benchmark_module: Callable[[str], ModuleType]) -> Any:
    return benchmark_module("moving")


def test_the_least_of_each_stretch_counts_whichever_run_it_is_of(moving: Any) -> None:
    runs = [[(0.5, 0.01), (0.5, 0.03)], [(0.5, 0.02), (0.5, 0.02)]]
    value, each = moving.speed(runs)
    assert value == pytest.approx(1.0 / 0.03)
    assert each == [25.0, 25.0]


def test_one_run_stands_for_itself(moving: Any) -> None:
    value, each = moving.speed([[(0.5, 0.01), (0.25, 0.005)]])
    assert value == pytest.approx(50.0)
    assert each == [50.0]


@pytest.mark.parametrize("other", [[(0.5, 0.01)], [(0.5, 0.01), (0.25, 0.01)]])
def test_runs_of_two_simulations_are_refused(moving: Any, other: list[tuple[float, float]]) -> None:
    with pytest.raises(ValueError, match="not of one simulation"):
        moving.speed([[(0.5, 0.01), (0.5, 0.01)], other])


@pytest.fixture(scope="module")
def kept_pictures(benchmark_module: Callable[[str], ModuleType]) -> Any:
    return benchmark_module("kept_pictures")


def panorama_of(seconds: float) -> list[bytes]:
    """Looks around for so long, and returns the pictures."""
    diagram = make_navigation_diagram(load_scenario("flat", "{task: {text: '@fridge'}}"))
    simulator = Simulator(diagram)
    simulator.AdvanceTo(seconds)
    observer = diagram.GetSubsystemByName("observer")
    context = observer.GetMyContextFromRoot(simulator.get_context())
    return [frame.jpeg for frame in observer.GetOutputPort("panorama").Eval(context).frames]


def test_kept_pictures_are_those_that_were_drawn(
    kept_pictures: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = kept_pictures.KeptPictures()
    with pictures.drawn():
        drawn = panorama_of(12.0)
    assert len(drawn) == 4

    def undrawable(*_: Any, **__: Any) -> None:
        raise AssertionError("drawn again")

    monkeypatch.setattr(RasterRenderer, "draw", undrawable)
    for _ in range(2):
        with pictures.shown():
            assert panorama_of(12.0) == drawn
    with pytest.raises(RuntimeError, match="pictures are left"), pictures.shown():
        panorama_of(1.0)
