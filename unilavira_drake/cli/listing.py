"""``unilavira scenarios`` and ``unilavira ports``: what there is."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Annotated, Any

import typer
from pydrake.common import pretty_class_name
from pydrake.systems.framework import (
    Diagram,
    OutputPort,
    PortDataType,
    System,
)
from rich.console import Console
from rich.table import Table

from unilavira_drake.diagram import make_navigation_diagram
from unilavira_drake.scenario import robot_kinds
from unilavira_drake.scenario_loading import load_scenario, scenario_names
from unilavira_drake.worlds.furniture_library import furniture_licences, furniture_models
from unilavira_drake.worlds.load import load_world

_OPAQUE = "station"
"""Drake's own plant and renderer are inside; its ports say what there is to know."""


def scenarios(
    furniture: Annotated[
        bool, typer.Option("--furniture", help="The furniture that worlds can use, instead.")
    ] = False,
) -> None:
    """Lists scenarios with their named tasks, worlds and robots; or the furniture library."""
    if furniture:
        _furniture()
        return
    console = Console(soft_wrap=True, highlight=False)
    for name in scenario_names():
        scenario = load_scenario(name)
        world = load_world(scenario.world.name)
        rooms = ", ".join(room.kind for room in world.rooms)
        console.print(f"scenario {name}: {scenario.description}", markup=False)
        console.print(f"  world {world.name}: {rooms}", markup=False)
        for task_name, task in scenario.tasks.items():
            chosen = " (default)" if task_name == scenario.default_task else ""
            console.print(f"  @{task_name}{chosen} [{task.family}] {task.text}", markup=False)
    console.print(f"robots: {', '.join(sorted(robot_kinds()))}", markup=False)


def _furniture() -> None:
    table = Table("name", "category", "size x, y, z [m]", "colour", "triangles", "licence")
    licences = furniture_licences()
    for name, model in furniture_models().items():
        size = " x ".join(f"{length:.2f}" for length in model.size)
        row = (name, model.category, size, model.color, str(model.triangles), licences[name])
        table.add_row(*row)
    console = _table_console()
    console.print(table)
    console.print("Authors and changes of each: models/furniture/ATTRIBUTION.csv", markup=False)


def _table_console() -> Console:
    """A file has no width: nothing is cut there."""
    return Console(width=None if sys.stdout.isatty() else 120, highlight=False)


def ports(
    scenario: Annotated[str, typer.Option(help="Name or file of the scenario.")] = "apartment",
    dot: Annotated[bool, typer.Option("--dot", help="Graphviz text instead of a table.")] = False,
    depth: Annotated[int, typer.Option(help="Levels of detail in the Graphviz text.")] = 2,
) -> None:
    """Shows every System with its ports, from the built Diagram."""
    diagram = make_navigation_diagram(load_scenario(scenario), on_message=_ignore)
    if dot:
        print(diagram.GetGraphvizString(max_depth=depth))
        return
    table = Table("system", "direction", "port", "carries")
    for row in _rows(diagram):
        table.add_row(*row)
    _table_console().print(table)


def _ignore(t: float, system: str, event: str, message: object) -> None:
    pass


def _rows(diagram: Diagram, prefix: str = "") -> Iterator[tuple[str, str, str, str]]:
    for system in diagram.GetSystems():
        name = f"{prefix}{system.get_name()}"
        yield from _port_rows(name, system)
        if isinstance(system, Diagram) and system.get_name() != _OPAQUE:
            yield from _rows(system, f"{name}.")


def _port_rows(name: str, system: System) -> Iterator[tuple[str, str, str, str]]:
    for index in range(system.num_input_ports()):
        entry = system.get_input_port(index)
        vector = entry.get_data_type() == PortDataType.kVectorValued
        carries = f"vector {entry.size()}" if vector else ""
        yield name, "in", entry.get_name(), carries
    for index in range(system.num_output_ports()):
        exit_ = system.get_output_port(index)
        vector = exit_.get_data_type() == PortDataType.kVectorValued
        carries = f"vector {exit_.size()}" if vector else _type_name(exit_)
        yield name, "out", exit_.get_name(), carries


def _type_name(port: OutputPort) -> str:
    allocated: Any = port.Allocate()
    name: str = pretty_class_name(type(allocated.get_value()))
    return name
