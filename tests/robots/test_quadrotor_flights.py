"""The quadrotor in a world: cameras, start, take-off, flights through doors, fence and air."""

import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from unilavira_drake import load_scenario
from unilavira_drake.diagram import make_navigation_diagram
from unilavira_drake.errors import ScenarioError
from unilavira_drake.messages import Goal, History, LanguageAction, Panorama, VisionAction
from unilavira_drake.ports import message_input
from unilavira_drake.scenario import plant_config
from unilavira_drake.station import add_navigation_station

SMALL = "robot: !Quadrotor {image_width: 96, image_height: 72}\n"
VIEWS = ("front", "left", "back", "right", "down")


def scenario_of(overlay=""):
    return load_scenario("flat", f"{SMALL}language_model: fixed\nvision_model: fixed\n{overlay}")


class Goals(LeafSystem):
    """In the place of the goal selector: goals of a list, whatever the model says."""

    def __init__(self, points):
        super().__init__()
        message_input(self, "vision_action", VisionAction())
        message_input(self, "history", History())
        self.panorama = message_input(self, "panorama", Panorama())
        self.action = message_input(self, "language_action", LanguageAction())
        self.points = points
        self.DeclareAbstractOutputPort("goal", lambda: AbstractValue.Make(Goal()), self.choose)

    def choose(self, context, output):
        n = self.action(context).n
        known = 0 < n == self.panorama(context).n and n <= len(self.points)
        output.set_value(Goal(n, "go", self.points[n - 1]) if known else Goal())


class Episode:
    """The whole diagram, with given goals; keeps the true positions."""

    def __init__(self, points, overlay=""):
        levels = {"goal_selector": Goals(points)}
        self.diagram = make_navigation_diagram(scenario_of(overlay), replace=levels)
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_context()
        self.positions = []

    def output(self, part, port):
        system = self.diagram.GetSubsystemByName(part)
        return system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(self.context))

    def fly_until(self, n, limit=60.0):
        """Returns the status of goal n once it is terminal."""
        while self.context.get_time() < limit:
            self.simulator.AdvanceTo(self.context.get_time() + 0.1)
            p_WB = self.output("station", "cheat_X_WB").translation()
            self.positions.append(np.array(p_WB))
            status = self.output("navigation", "navigation_status")
            if status.n >= n and status.terminal:
                return status
        raise AssertionError(f"goal {n} is not done after {limit} s: {status}")


def station_of(overlay="", X_WB_start=None):
    builder = DiagramBuilder()
    station = add_navigation_station(builder, scenario_of(overlay), X_WB_start=X_WB_start)
    diagram = builder.Build()
    return station, diagram, diagram.CreateDefaultContext()


def test_five_cameras_look_where_their_names_say():
    station, _, root = station_of()
    context = station.GetMyContextFromRoot(root)
    axes = {"front": (1, 0, 0), "left": (0, 1, 0), "back": (-1, 0, 0), "right": (0, -1, 0)}
    for view, axis in axes.items():
        R_BC = station.GetOutputPort(f"{view}.X_BC").Eval(context).rotation().matrix()
        np.testing.assert_allclose(R_BC[:, 2], axis, atol=1e-9)
        np.testing.assert_allclose(R_BC[:, 1], (0, 0, -1), atol=1e-9)
    R_BC = station.GetOutputPort("down.X_BC").Eval(context).rotation().matrix()
    np.testing.assert_allclose(R_BC[:, 2], (0, 0, -1), atol=1e-9)
    # The top of its picture is ahead.
    np.testing.assert_allclose(-R_BC[:, 1], (1, 0, 0), atol=1e-9)


def test_no_camera_sees_its_own_robot():
    X_WB = RigidTransform(RotationMatrix(), [6.0, 5.0, 1.3])
    station, _, root = station_of(X_WB_start=X_WB)
    context = station.GetMyContextFromRoot(root)
    for view in VIEWS:
        depth = station.GetOutputPort(f"{view}.depth_image").Eval(context).data
        assert depth.min() > 0.3
    depth = station.GetOutputPort("down.depth_image").Eval(context).data[36, 48, 0]
    assert depth == pytest.approx(1.3 - 0.05, abs=0.02)


def test_the_plant_s_steps_are_as_short_as_its_autopilot_needs():
    scenario = scenario_of()
    assert scenario.plant.time_step == 0.025
    assert plant_config(scenario).time_step == 0.01
    assert plant_config(load_scenario("flat")).time_step == 0.025


def test_it_climbs_first_and_then_captures_five_views_at_once():
    episode = Episode([(2.9, 7.4, 1.5)])
    status = episode.fly_until(0)
    heights = [p[2] for p in episode.positions]
    assert heights[0] < 0.15
    assert (status.n, status.state) == (0, "arrived")
    assert heights[-1] == pytest.approx(1.2, abs=0.25)
    assert max(heights) < 1.5
    episode.fly_until(1)
    panorama = episode.output("observer", "panorama")
    assert [frame.view for frame in panorama.frames] == ["front", "left", "back", "right", "down"]
    times = {frame.time for frame in panorama.frames}
    assert len(times) == 1
    assert panorama.position[2] == pytest.approx(1.2, abs=0.25)


def test_it_flies_through_doors_in_gusts_and_touches_nothing():
    points = [(2.2, 5.0, 1.2), (7.6, 5.0, 1.6), (7.6, 2.4, 1.2)]
    episode = Episode(points, "flight: {wind: {speed: 0.3, gusts: 0.4}}")
    for n, point in enumerate(points, start=1):
        status = episode.fly_until(n, limit=100.0)
        assert status.state == "arrived"
        assert np.linalg.norm(episode.positions[-1] - point) < 0.4
    metrics = episode.output("episode_monitor", "metrics")
    assert metrics.collisions == 0
    assert metrics.path_length > 10.0


def test_it_never_leaves_the_fence():
    fence = "flight: {geofence: [0.0, 4.3, 5.0, 10.0], max_altitude: 1.6}"
    episode = Episode([(2.2, 5.0, 1.2), (7.6, 5.0, 1.2)], fence)
    episode.fly_until(1)
    status = episode.fly_until(2)
    assert status.reason == "the airspace ends here"
    flown = np.array(episode.positions)
    assert flown[:, 0].max() < 5.0 + 0.25
    assert flown[:, 2].max() < 1.6 + 0.1


def test_the_same_seed_is_the_same_flight():
    ends = []
    for seed in (0, 0, 1):
        wind = f"random_seed: {seed}\nflight: {{wind: {{gusts: 0.5}}}}"
        episode = Episode([(2.2, 6.0, 1.2)], wind)
        episode.fly_until(1)
        ends.append(np.array(episode.positions))
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0][:20], ends[2][:20])


def test_one_camera_turns_to_look_around_and_looks_down_last():
    views = "robot: !Quadrotor {views: [front, down], image_width: 96, image_height: 72}"
    episode = Episode([(2.9, 7.4, 1.5)], views)
    episode.fly_until(1)
    panorama = episode.output("observer", "panorama")
    assert {frame.view for frame in panorama.frames} == set(VIEWS)
    yaws = {frame.view: math.atan2(frame.X_WC[1, 2], frame.X_WC[0, 2]) for frame in panorama.frames}
    turned = math.remainder(yaws["left"] - yaws["front"] - math.pi / 2, 2 * math.pi)
    assert abs(turned) < 0.15


@pytest.mark.parametrize(
    ("setting", "fragments"),
    [
        ("flight: {geofence: [0, 0, 1]}", ["flight.geofence", "x_min, y_min, x_max, y_max"]),
        ("flight: {geofence: [5, 0, 1, 9]}", ["flight.geofence"]),
        ("flight: {takeoff_altitude: 9}", ["flight.takeoff_altitude", "max_altitude"]),
        ("flight: {min_altitude: 3}", ["flight.min_altitude", "flight.max_altitude"]),
        ("flight: {resolution: 0.01}", ["flight.max_range"]),
        ("flight: {wind: {gusts: -1}}", ["flight.wind.gusts", "not negative"]),
        ("robot: !Quadrotor {max_tilt_degrees: 80}", ["robot.max_tilt_degrees", "1 to 45"]),
        ("robot: !Quadrotor {autopilot_period: 0.007}", ["robot.autopilot_period", "0.01"]),
    ],
)
def test_what_cannot_fly_is_told(setting, fragments):
    with pytest.raises(ScenarioError) as caught:
        scenario_of(setting) if setting.startswith("robot") else load_scenario(
            "flat", f"{SMALL.splitlines()[0]}\n{setting}"
        )
    for fragment in fragments:
        assert fragment in str(caught.value)
