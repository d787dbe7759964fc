"""Wiring levels by name, with errors that say which level and which port."""

from __future__ import annotations

from collections.abc import Callable, MutableMapping

from pydrake.systems.framework import (
    Diagram,
    DiagramBuilder,
    InputPort,
    OutputPort,
    System,
)

from unilavira_drake.errors import PortTypeError


class Wiring:
    """Builds one Diagram of named levels; a level in ``replace`` takes the place of ours.

    Args:
        replace: user's Systems by level name; a used one is taken out of the mapping.
    """

    def __init__(self, replace: MutableMapping[str, System] | None = None) -> None:
        self._builder = DiagramBuilder()
        self._replace = {} if replace is None else replace
        self._levels: dict[str, System] = {}
        self._exported: set[str] = set()

    def add(self, name: str, make: Callable[[], System]) -> System:
        """Adds a level: the user's own if there is one, else the one that ``make`` returns."""
        own = self._replace.pop(name, None)
        level = make() if own is None else own
        self._builder.AddNamedSystem(name, level)
        self._levels[name] = level
        return level

    def connect(self, source: str, port: str, target: str, target_port: str | None = None) -> None:
        """Connects an output port to the input port of the same (or the given) name.

        Raises:
            PortTypeError: if a replaced level lacks the port.
        """
        self._builder.Connect(self._output(source, port), self._input(target, target_port or port))

    def connect_wanted(self, source: str, port: str, target: str) -> None:
        """Connects ports of one name where both levels have such a port."""
        if self._levels[source].HasOutputPort(port) and self._levels[target].HasInputPort(port):
            self.connect(source, port, target)

    def take_wanted(self, name: str, level: str) -> None:
        """Makes an input port of the Diagram where the level has a port of that name."""
        if self._levels[level].HasInputPort(name):
            self.take_input(name, level)

    def give_wanted(self, level: str, port: str, name: str) -> None:
        """Makes an output port of the Diagram where the level has the port."""
        if self._levels[level].HasOutputPort(port):
            self.give_output(level, port, name)

    def take_input(self, name: str, *levels: str) -> None:
        """Makes an input port of the Diagram that feeds the port of that name of each level."""
        for level in levels:
            port = self._input(level, name)
            if name in self._exported:
                self._builder.ConnectInput(name, port)
            else:
                self._builder.ExportInput(port, name)
                self._exported.add(name)

    def give_output(self, level: str, port: str, name: str | None = None) -> None:
        """Makes an output port of the Diagram."""
        self._builder.ExportOutput(self._output(level, port), name or port)

    def build(self, name: str) -> Diagram:
        """Returns the Diagram."""
        diagram = self._builder.Build()
        diagram.set_name(name)
        return diagram

    def _input(self, level: str, port: str) -> InputPort:
        system = self._levels[level]
        if not system.HasInputPort(port):
            names = [
                system.get_input_port(i, warn_deprecated=False).get_name()
                for i in range(system.num_input_ports())
            ]
            raise PortTypeError(_missing(level, "input", port, names))
        return system.GetInputPort(port)

    def _output(self, level: str, port: str) -> OutputPort:
        system = self._levels[level]
        if not system.HasOutputPort(port):
            names = [system.get_output_port(i).get_name() for i in range(system.num_output_ports())]
            raise PortTypeError(_missing(level, "output", port, names))
        return system.GetOutputPort(port)


def _missing(level: str, kind: str, port: str, names: list[str]) -> str:
    return (
        f"level {level!r} has no {kind} port {port!r} (it has: {', '.join(names) or 'none'}); "
        "a level that takes our level's place needs the same ports."
    )
