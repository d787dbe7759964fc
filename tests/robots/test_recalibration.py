"""Recalibration in an episode's Diagram: the drift of the pose ends, and begins anew."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from unilavira_drake import load_scenario, make_navigation_diagram
from unilavira_drake.errors import ScenarioError
from unilavira_drake.robots.planar_base import PlanarBase
from unilavira_drake.robots.recalibration import Recalibration

DRIFTING = (
    "{pose_estimate: {position_drift: 2.0, yaw_drift_degrees: 5.0}, task: {text: '@couch'},"
    " recalibration_period: %s}"
)


def errors(period: str, times: list[float]) -> list[float]:
    """How far the pose estimate is from the truth at some times of an episode."""
    diagram = make_navigation_diagram(load_scenario("flat", DRIFTING % period))
    simulator, found = Simulator(diagram), []
    station = diagram.GetSubsystemByName("station")
    for time in times:
        simulator.AdvanceTo(time)
        context = station.GetMyContextFromRoot(simulator.get_context())
        places = [
            station.GetOutputPort(port).Eval(context).translation()
            for port in ("pose_estimate", "cheat_X_WB")
        ]
        found.append(float(np.linalg.norm(places[0] - places[1])))
    return found


def test_a_recalibration_ends_the_drift() -> None:
    free = errors("0", [11.9, 12.2])
    ended = errors("12", [11.9, 12.2])
    assert free[0] == ended[0] > 0.005
    assert free[1] > 0.5 * free[0]
    assert ended[1] < 0.4 * ended[0]


def test_the_count_grows_with_each_period() -> None:
    clock = Recalibration(period=10.0)
    context = clock.CreateDefaultContext()
    for time, count in ((0.0, 0), (9.99, 0), (10.0 - 1e-12, 1), (35.0, 3)):
        context.SetTime(time)
        assert clock.GetOutputPort("recalibrations").Eval(context)[0] == count


def test_an_aircraft_takes_no_locomotion_and_knows_no_people() -> None:
    scenario = load_scenario("flat", "robot: !Quadrotor {}")
    with pytest.raises(ScenarioError, match="locomotion"):
        make_navigation_diagram(scenario, replace={"locomotion": PlanarBase()})
