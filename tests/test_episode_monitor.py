"""The episode monitor on fixed inputs."""

import math

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import (
    ContactResults,
)
from pydrake.systems.analysis import Simulator, SimulatorStatus

from unilavira_drake.episode_monitor import EpisodeMonitor
from unilavira_drake.messages import LanguageAction, NavigationStatus, Panorama
from unilavira_drake.messages.metrics import CAUSES, EpisodeMetrics
from unilavira_drake.messages.people import PeopleTruth, PersonTruth
from unilavira_drake.mllm.reply import Usage
from unilavira_drake.mllm.usage import ModelUsage
from unilavira_drake.scenario import Budgets

PERIOD = 0.1


class Bench:
    """A monitor whose inputs are set by hand, one tick at a time."""

    def __init__(self, goal_distance=None, flies=False, **budgets):
        self.monitor = EpisodeMonitor(
            period=PERIOD, budgets=Budgets(**budgets), goal_distance=goal_distance, flies=flies
        )
        self.simulator = Simulator(self.monitor)
        self.context = self.simulator.get_mutable_context()
        self.pose(0.0, 0.0)
        self.fix("language_action", LanguageAction())
        self.fix("panorama", Panorama())
        self.fix("navigation_status", NavigationStatus())
        self.fix("contact_results", ContactResults())
        self.status = None

    def fix(self, name, value):
        self.monitor.GetInputPort(name).FixValue(self.context, AbstractValue.Make(value))

    def pose(self, x, y, yaw=0.0):
        self.fix("cheat_X_WB", RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, 0.0]))

    def act(self, n, call, tool, status="arrived", **fields):
        """Shows a language action and how its goal goes."""
        self.fix("language_action", LanguageAction(n=n, call=call, tool=tool, **fields))
        self.fix("navigation_status", NavigationStatus(n, status))
        self.tick()
        self.tick()

    def tick(self):
        self.status = self.simulator.AdvanceTo(self.context.get_time() + PERIOD)
        return self.metrics

    @property
    def metrics(self):
        return self.monitor.GetOutputPort("metrics").Eval(self.context)

    @property
    def terminated(self):
        return self.status.reason() == SimulatorStatus.ReturnReason.kReachedTerminationCondition


def test_the_path_and_the_least_distance_follow_the_true_pose():
    bench = Bench(goal_distance=lambda x, y, z: math.hypot(x - 2.0, y))
    bench.tick()
    for angle in np.linspace(0.0, math.pi, 101):
        bench.pose(1 - math.cos(angle), math.sin(angle))
        bench.tick()
    bench.tick()
    metrics = bench.metrics
    assert metrics.path_length == pytest.approx(math.pi, rel=1e-3)
    assert metrics.position == pytest.approx((2.0, 0.0), abs=1e-3)
    bench.pose(3.0, 0.0)
    bench.tick()
    bench.tick()
    assert bench.metrics.goal_distance == pytest.approx(1.0)
    assert bench.metrics.min_goal_distance == pytest.approx(0.0, abs=1e-2)


def test_the_start_is_no_step_and_trembling_adds_nothing():
    bench = Bench()
    bench.pose(5.0, 7.0)
    for k in range(10):
        bench.pose(5.0 + 0.0004 * (k % 2), 7.0)
        bench.tick()
    assert bench.metrics.path_length == 0.0
    assert bench.metrics.position == pytest.approx((5.0, 7.0), abs=1e-3)
    assert bench.metrics.goal_distance is None


def test_an_aircraft_that_hovers_in_gusts_goes_nowhere():
    bench = Bench(goal_distance=lambda x, y, z: math.hypot(x, y), flies=True, stall=10.0)
    rng = np.random.default_rng(1)
    while not bench.metrics.ended and bench.context.get_time() < 15.0:
        bench.pose(*(3.0 + rng.uniform(-0.08, 0.08, 2)), rng.uniform(-0.08, 0.08))
        bench.tick()
    assert bench.metrics.path_length == 0.0
    assert bench.metrics.cause == "stalled"
    assert bench.metrics.time == pytest.approx(10.0, abs=0.3)
    assert bench.metrics.min_goal_distance < math.hypot(3.0, 3.0)


def test_an_aircraft_that_flies_slowly_gets_on():
    bench = Bench(flies=True, stall=10.0)
    for k in range(300):
        bench.pose(0.01 * k, 0.0)
        bench.tick()
    assert not bench.metrics.ended
    assert bench.metrics.path_length == pytest.approx(2.99, abs=0.26)
    assert bench.metrics.position == pytest.approx((2.99, 0.0), abs=0.02)
    for k in range(300):
        bench.pose(3.0, 0.0, 0.02 * k)
        bench.tick()
    assert not bench.metrics.ended


def test_a_stop_is_written_in_one_tick_and_ends_in_the_next():
    bench = Bench()
    bench.tick()
    bench.fix("language_action", LanguageAction(n=4, call="double_check", tool="stop"))
    while not bench.metrics.ended:
        bench.tick()
        assert not bench.terminated
    assert bench.metrics.cause == "stopped"
    written = bench.context.get_time()
    bench.tick()
    assert bench.terminated
    assert bench.context.get_time() <= written + PERIOD + 1e-9
    assert bench.status.message() == "stopped"


def test_only_decide_and_recover_are_decisions():
    bench = Bench(decisions=3)
    calls = ("plan_todo", "decide", "double_check", "recover", "answer")
    for n, call in enumerate(calls, start=1):
        bench.act(n, call, "stay")
    assert bench.metrics.decisions == 2
    assert not bench.metrics.ended
    bench.act(6, "decide", "turn")
    assert bench.metrics.cause == "decision_budget"


def test_the_last_decision_is_carried_out_and_its_stop_is_checked():
    bench = Bench(decisions=1)
    bench.act(1, "decide", "double_check")
    assert not bench.metrics.ended
    bench.act(2, "double_check", "stay", confirmed=False)
    assert bench.metrics.cause == "decision_budget"
    bench = Bench(decisions=1)
    bench.act(1, "decide", "turn", status="moving")
    assert not bench.metrics.ended
    bench.fix("navigation_status", NavigationStatus(1, "arrived"))
    bench.tick()
    bench.tick()
    assert bench.metrics.cause == "decision_budget"


def test_simulated_time_runs_out():
    bench = Bench(simulated_time=1.0)
    while not bench.metrics.ended:
        bench.pose(bench.context.get_time(), 0.0)
        bench.tick()
    assert bench.metrics.cause == "time_budget"
    assert bench.metrics.time == pytest.approx(1.0)


NEWS = {
    "panorama": lambda bench, k: bench.fix("panorama", Panorama(n=k)),
    "action": lambda bench, k: bench.fix("language_action", LanguageAction(n=k)),
    "status": lambda bench, k: bench.fix("navigation_status", NavigationStatus(k, "moving")),
    "state": lambda bench, k: bench.fix(
        "navigation_status", NavigationStatus(1, ("moving", "failed")[k % 2])
    ),
    "motion": lambda bench, k: bench.pose(0.01 * k, 0.0),
    "turning": lambda bench, k: bench.pose(0.0, 0.0, 0.1 * k),
}


@pytest.mark.parametrize("news", NEWS)
def test_any_progress_puts_off_the_stall(news):
    bench = Bench(stall=1.0)
    for k in range(1, 10):
        NEWS[news](bench, k)
        for _ in range(5):
            bench.tick()
    assert not bench.metrics.ended
    for _ in range(12):
        bench.tick()
    assert bench.metrics.cause == "stalled"


def test_a_model_may_think_longer_than_the_stall():
    bench = Bench(stall=1.0)
    bench.fix("language_usage", ModelUsage(asked=1))
    for _ in range(30):
        bench.tick()
    assert not bench.metrics.ended
    bench.fix("language_usage", ModelUsage(asked=1, calls=1))
    for _ in range(5):
        bench.tick()
    assert not bench.metrics.ended
    for _ in range(12):
        bench.tick()
    assert bench.metrics.cause == "stalled"


MODEL_BUDGETS = {
    "call_budget": {"model_calls": 5},
    "token_budget": {"model_tokens": 2200},
    "model_time_budget": {"model_seconds": 50.0},
    "cost_budget": {"model_cost_usd": 0.5},
}
LANGUAGE = ModelUsage(3, 0, 4, Usage(1000, 100, 8, 0.25), 0.25, 45.0)
VISION = ModelUsage(2, 1, 2, Usage(1000, 100, 2, None), 0.25, 5.0)


@pytest.mark.parametrize("cause", MODEL_BUDGETS)
def test_the_budgets_of_the_models_count_both_together(cause):
    bench = Bench(**MODEL_BUDGETS[cause])
    bench.fix("language_usage", LANGUAGE)
    bench.fix("vision_usage", ModelUsage())
    for _ in range(3):
        bench.tick()
    assert not bench.metrics.ended
    bench.fix("vision_usage", VISION)
    for _ in range(3):
        bench.tick()
    assert bench.metrics.cause == cause


@pytest.mark.parametrize("budget", ["model_tokens", "model_cost_usd"])
def test_a_budget_that_nobody_counts_is_not_kept_in_silence(budget):
    uncounted = ModelUsage(calls=1, asked=1, uncounted=1)
    for budgets, cause in (({budget: 1000}, "tokens_not_counted"), ({"model_calls": 9}, "")):
        bench = Bench(**budgets)
        bench.fix("language_usage", uncounted)
        for _ in range(3):
            bench.tick()
        assert bench.metrics.cause == cause


def test_without_a_budget_nothing_is_counted():
    bench = Bench()
    bench.fix("language_usage", LANGUAGE)
    for _ in range(5):
        bench.tick()
    assert not bench.metrics.ended


def test_a_stop_in_the_last_reply_of_a_budget_counts():
    bench = Bench(model_calls=3)
    bench.tick()
    bench.fix("language_usage", LANGUAGE)
    bench.tick()
    # The language level reads its reply a tick after the link has shown it.
    bench.fix("language_action", LanguageAction(n=3, call="double_check", tool="stop"))
    bench.tick()
    bench.tick()
    assert bench.metrics.cause == "stopped"


def test_an_unreachable_model_ends_the_episode_before_anything_else():
    bench = Bench(model_calls=1)
    bench.fix("vision_usage", ModelUsage(1, 1, failure="MllmUnreachable: refused"))
    bench.fix("language_action", LanguageAction(n=3, call="answer", tool="stop"))
    bench.tick()
    bench.tick()
    assert bench.metrics.cause == "model_unreachable"


def person(gap, *, touched=False, name="person_1"):
    return PersonTruth(name, gap=gap, touched=touched)


def test_people_are_measured_by_the_least_gap_and_the_onsets_of_touches():
    bench = Bench()
    for people in (
        (person(1.5), person(0.9, name="person_2")),
        (person(0.4), person(2.0, name="person_2")),
        (person(0.0, touched=True), person(0.0, touched=True, name="person_2")),
        (person(0.0), person(0.0, touched=True, name="person_2")),
        (person(0.3), person(0.8, name="person_2")),
        (person(0.0, touched=True), person(1.0, name="person_2")),
    ):
        bench.fix("cheat_people", PeopleTruth(people))
        bench.tick()
        bench.tick()
        if people[0].gap == 0.4:
            assert bench.metrics.min_person_distance == 0.4
            assert bench.metrics.person_contacts == 0
    # Two people at once are one contact: it ends when nobody is touched.
    assert bench.metrics.person_contacts == 2
    assert bench.metrics.min_person_distance == 0.0
    assert bench.metrics.collisions == 0


@pytest.mark.parametrize(
    "people", [None, PeopleTruth(), PeopleTruth((PersonTruth("person_1", gap=math.inf),))]
)
def test_where_nobody_walks_nothing_is_said_of_people(people):
    bench = Bench()
    if people is not None:
        bench.fix("cheat_people", people)
    bench.tick()
    bench.tick()
    assert bench.metrics.min_person_distance is None
    assert bench.metrics.person_contacts == 0


def test_every_cause_has_its_sentence():
    assert set(CAUSES) >= {"stopped", "decision_budget", "time_budget", "stalled", *MODEL_BUDGETS}
    assert all(text.endswith(".") for text in CAUSES.values())
    assert EpisodeMetrics(cause="stopped").ended
