"""One agent for all families: the same Diagram, the same prompts but for the task's words."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import jinja2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.framework import Diagram, System

from unilavira_drake import load_scenario, make_navigation_diagram
from unilavira_drake.errors import ScenarioError, TaskError
from unilavira_drake.language.variables import language_request
from unilavira_drake.messages import (
    CALLS,
    DIRECTIONS,
    Frame,
    History,
    LanguageAction,
    Panorama,
    SecondChance,
    TodoItem,
    TodoList,
)
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.request import MllmRequest, VisionVariables
from unilavira_drake.resources import prompts_path
from unilavira_drake.task_choice import choose_task
from unilavira_drake.tasks import (
    FAMILIES,
    FAMILY_TABLE,
    HOME,
    SuccessRule,
    TaskSpec,
    asks,
    checked_task,
    success_rule,
)

GROUND = ("vln", "objectnav", "eqa")
TEXT = "Go to the red sofa."


def diagram_of(family: str, ablation: str) -> Diagram:
    task = f"{{family: {family}, text: '{TEXT}', start: kitchen, goal: sofa_1}}"
    overlay = f"tasks: {{same: {task}}}\ntask: {{text: '@same'}}\nablation: {ablation}"
    return make_navigation_diagram(load_scenario("flat", overlay))


def levels(system: System, path: str = "") -> dict[str, list[str]]:
    """Returns the ports of every System of ours, with what they carry."""
    path = f"{path}/{system.get_name()}"
    ports: list[Any] = [system.get_input_port(i) for i in range(system.num_input_ports())]
    ports += [system.get_output_port(i) for i in range(system.num_output_ports())]
    found = {path: [f"{p.get_name()} {p.get_data_type()} {p.size()}" for p in ports]}
    if isinstance(system, Diagram):
        for part in system.GetSystems():
            found |= levels(part, path)
    return found


def graph(diagram: Diagram) -> list[str]:
    """Returns the lines of the Graphviz text, without the numbers and the order of each process."""
    names: dict[str, str] = {}
    plain = re.sub(
        r"(?<=digraph _)\d+|(?<=cluster)\d+|(?<=s)\d+(?=in|out|\b)",
        lambda found: names.setdefault(found.group(), f"<{len(names)}>"),
        diagram.GetGraphvizString(),
    )
    return sorted(plain.splitlines())


@pytest.mark.parametrize("ablation", ["full", "no_both"])
def test_the_diagram_is_the_same_for_every_family(ablation: str) -> None:
    first, *others = (diagram_of(family, ablation) for family in GROUND)
    assert ("name=todo_memory" in graph(first)) is (ablation == "full")
    for other in others:
        assert levels(other) == levels(first)
        assert graph(other) == graph(first)
        parts = [type(part) for part in first.GetSystems()]
        assert [type(part) for part in other.GetSystems()] == parts


def request(family: str, call: str, *, bare: bool = False) -> MllmRequest:
    task = TaskSpec(family, TEXT)
    todo = TodoList(n=3, items=(TodoItem("Find it", "completed", "seen"), TodoItem("Go to it")))
    if call == "ground":
        return MllmRequest(
            "vision", 4, call=call,
            variables=VisionVariables(task.family, task.text, todo=None if bare else todo.items),
        )  # fmt: skip
    frames = tuple(Frame(view=d, jpeg=d.encode()) for d in DIRECTIONS)
    return language_request(
        call=call, seed=0, task=task, panorama=Panorama(n=4, frames=frames), history=History(),
        second_chance=None if bare else SecondChance(), todo=None if bare else todo,
        last_action=LanguageAction(), can_climb=False, free_distance=lambda frame: 2.0,
        detector=None,
    )  # fmt: skip


def words(family: str) -> list[str]:
    """Returns the words of a family, one text for each level that reads them, longest first."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(prompts_path()), trim_blocks=True, lstrip_blocks=True
    )
    module: Any = environment.get_template(f"tasks/{family}.txt.j2").module
    macros = (module.task, module.plan, module.check, module.ground)
    texts = [str(macro()).strip() for macro in macros]
    return sorted(texts, key=len, reverse=True)


@pytest.mark.parametrize("bare", [False, True])
@pytest.mark.parametrize("call", [*CALLS, "ground"])
def test_prompts_differ_in_the_words_of_the_task_alone(call: str, bare: bool) -> None:
    texts, plain = set(), set()
    for family in GROUND:
        text = compose_prompt(request(family, call, bare=bare)).text
        texts.add(text)
        for part in words(family):
            text = text.replace(part, "<words of the family>")
        plain.add(text)
    assert len(texts) == len(GROUND)
    assert len(plain) == 1
    assert "<words of the family>" in plain.pop()


@pytest.mark.parametrize("call", [*CALLS, "ground"])
def test_requests_differ_in_the_family_alone(call: str) -> None:
    first = request("vln", call)
    for family in GROUND[1:]:
        other = request(family, call)
        named = dataclasses.replace(first.variables, family=family)
        assert other == dataclasses.replace(first, variables=named)


def test_no_template_but_those_of_the_families_names_one() -> None:
    names = re.compile(rf"\b({'|'.join(FAMILIES)})\b", re.IGNORECASE)
    for path in sorted(prompts_path().rglob("*.j2")):
        if path.parent.name != "tasks":
            text = path.read_text(encoding="utf-8")
            assert not names.search(text), path
            assert not re.search(r"{%-?\s*(el)?if[^%]*\bfamily\b", text), path


def test_the_table_says_what_a_family_is() -> None:
    assert FAMILIES == ("vln", "objectnav", "eqa", "aerial_vln")
    for name, family in FAMILY_TABLE.items():
        assert family.name == name
        assert family.rules[0].protocol == HOME
        protocols = [rule.protocol for rule in family.rules]
        assert len(set(protocols)) == len(protocols)
        assert all(rule.radius > 0 for rule in family.rules)
        assert all(rule.by_answer == asks(name) for rule in family.rules)
        assert family.budgets.decisions > 0
        assert (prompts_path() / "tasks" / f"{name}.txt.j2").is_file()


@pytest.mark.parametrize(
    ("family", "protocol", "radius", "strict"),
    [
        ("vln", "home", 1.5, False),
        ("vln", "habitat", 3.0, True),
        ("objectnav", "habitat", 0.1, True),
        ("objectnav", "ovon", 0.25, True),
        ("objectnav", "uni_lavira", 1.0, True),
        ("aerial_vln", "uni_lavira", 20.0, False),
    ],
)
def test_the_radii_of_the_protocols(
    family: str, protocol: str, radius: float, strict: bool
) -> None:
    rule = success_rule(family, protocol)
    assert (rule.radius, rule.strict) == (radius, strict)
    assert rule.reached(radius) is not strict
    assert rule.reached(radius * 0.999)
    assert not rule.reached(radius * 1.001)
    assert (rule.in_room and rule.seen) is (protocol == HOME)


def test_a_protocol_that_does_not_score_a_family_is_named() -> None:
    with pytest.raises(TaskError, match=r"ovon.*valid: habitat, home, uni_lavira"):
        success_rule("vln", "ovon")
    with pytest.raises(ScenarioError, match=r"tasks\.fridge: .*protocol"):
        load_scenario("flat", "tasks: {fridge: {protocol: ovn}}")


def test_a_task_says_what_it_asks_for_and_holds_no_goal() -> None:
    assert TaskSpec("vln", TEXT).answer_type == "none"
    question = checked_task("What color?", "eqa")
    assert (question.answer_type, question.success) == ("open", SuccessRule(by_answer=True))
    closed = checked_task("What color?", "eqa", [" dark  red", "blue"])
    assert (closed.answer_type, closed.choices) == ("closed", ("dark red", "blue"))
    for spec in (question, closed):
        assert not {"goal", "answer", "answers", "accept"} & set(dir(spec))


@pytest.mark.parametrize(
    ("family", "choices", "hint"),
    [
        ("vln", ["red", "blue"], "are for questions"),
        ("eqa", ["red"], "two different"),
        ("eqa", ["red", "Red"], "two different"),
        ("eqa", ["red", " "], "none empty"),
    ],
)
def test_wrong_choices_are_named(family: str, choices: list[str], hint: str) -> None:
    with pytest.raises(TaskError, match=hint):
        checked_task(TEXT, family, choices)
    with pytest.raises(ScenarioError, match=r"tasks\.odd"):
        load_scenario(
            "flat", f"tasks: {{odd: {{family: {family}, text: Go., choices: {choices}}}}}"
        )


@settings(derandomize=True, deadline=None, max_examples=30)
@given(
    st.sampled_from(FAMILIES),
    st.none() | st.integers(1, 99),
    st.none() | st.floats(1.0, 1e4),
)
def test_a_budget_that_is_not_given_is_the_familys(
    family: str, decisions: int | None, seconds: float | None
) -> None:
    scenario = dataclasses.replace(FLAT)
    scenario.budgets = dataclasses.replace(
        FLAT.budgets, decisions=decisions, simulated_time=seconds
    )
    scenario.tasks = {"any": dataclasses.replace(FLAT.tasks["fridge"], family=family)}
    scenario.task = dataclasses.replace(FLAT.task, text="@any")
    budgets, usual = choose_task(scenario).budgets, FAMILY_TABLE[family].budgets
    assert budgets.decisions == (decisions or usual.decisions)
    assert budgets.simulated_time == (seconds or usual.simulated_time)
    assert budgets.stall == FLAT.budgets.stall


FLAT = load_scenario("flat")
