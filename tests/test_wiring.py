"""Wiring by name: replacements and their errors."""

from __future__ import annotations

import pytest
from pydrake.systems.framework import System
from pydrake.systems.primitives import ConstantVectorSource, Gain, PassThrough

from unilavira_drake.errors import PortTypeError
from unilavira_drake.wiring import Wiring


def test_a_replaced_level_takes_the_place_of_ours() -> None:
    own: dict[str, System] = {"gain": Gain(k=3.0, size=1)}
    wiring = Wiring(own)
    wiring.add("source", lambda: ConstantVectorSource([2.0]))
    wiring.add("gain", lambda: PassThrough(1))
    wiring.connect("source", "y0", "gain", "u0")
    wiring.give_output("gain", "y0", "result")
    diagram = wiring.build("test")
    assert own == {}
    context = diagram.CreateDefaultContext()
    assert diagram.GetOutputPort("result").Eval(context) == [6.0]


def test_a_missing_port_is_named_with_those_that_exist() -> None:
    wiring = Wiring({"gain": PassThrough(1)})
    wiring.add("source", lambda: ConstantVectorSource([2.0]))
    wiring.add("gain", lambda: Gain(k=1.0, size=1))
    with pytest.raises(PortTypeError, match=r"'gain' has no input port 'path'.*it has: u"):
        wiring.connect("source", "y0", "gain", "path")


def test_one_input_of_the_diagram_feeds_several_levels() -> None:
    wiring = Wiring()
    for name in ("a", "b"):
        wiring.add(name, lambda: PassThrough(1))
        wiring.give_output(name, "y", name)
    wiring.take_input("u", "a", "b")
    diagram = wiring.build("test")
    assert diagram.num_input_ports() == 1
    context = diagram.CreateDefaultContext()
    diagram.GetInputPort("u").FixValue(context, [5.0])
    assert [diagram.GetOutputPort(name).Eval(context)[0] for name in ("a", "b")] == [5.0, 5.0]
