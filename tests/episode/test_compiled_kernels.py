"""Every kernel that an episode calls is compiled when its Systems are built."""

from __future__ import annotations

import subprocess
import sys

# In a process of its own: here, other tests have compiled already.
PROGRAM = """
import sys
from numba.core.dispatcher import Dispatcher
from pydrake.systems.analysis import Simulator
from unilavira_drake import load_scenario, make_navigation_diagram

def compiled():
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith("unilavira_drake"):
            for key, value in vars(module).items():
                if isinstance(value, Dispatcher):
                    found[f"{value.py_func.__module__}.{value.py_func.__name__}"] = len(
                        value.signatures
                    )
    return found

scenario = load_scenario("apartment", "task: {text: '@fridge'}")
diagram = make_navigation_diagram(scenario)
simulator = Simulator(diagram)
simulator.Initialize()
before = compiled()
simulator.AdvanceTo(60.0)
after = compiled()
status = diagram.GetSubsystemByName("navigation").GetOutputPort("navigation_status")
context = diagram.GetSubsystemByName("navigation").GetMyContextFromRoot(simulator.get_context())
assert status.Eval(context).n >= 2, status.Eval(context)
late = {name: count for name, count in after.items() if count > before.get(name, 0)}
print(len(before), "kernels; compiled under way:", late)
sys.exit(bool(late))
"""


def test_no_control_loop_waits_for_the_compiler() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
