"""What holds of waypoints and second chances after any walk whatever (paper III-D)."""

from __future__ import annotations

import math
from typing import NamedTuple

import pytest
from diary import PLACES, Walk, word_of
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from unilavira_drake.memory.pictures import LEAST_OF_LEG
from unilavira_drake.memory.waypoints import MemoryBounds
from unilavira_drake.messages import DIRECTIONS

KINDS = (
    "turn", "turn", "turn", "stuck", "in vain", "to here", "back", "back", "back", "back stuck",
    "back in vain", "back to nothing", "wait",
)  # fmt: skip


class Step(NamedTuple):
    """What to do, and with what direction, waypoint, place, yaw, and so on."""

    kind: str
    which: int
    place: int
    yaw: float
    shift: float
    seen: int


Plan = tuple[MemoryBounds, list[Step]]


@st.composite
def plans(draw: st.DrawFn) -> Plan:
    """Bounds of a memory, and a walk."""
    bounds = MemoryBounds(
        waypoints=draw(st.integers(2, 6)),
        decisions=draw(st.integers(1, 4)),
        keyframes=draw(st.integers(0, 8)),
        merge_distance=0.5,
    )
    quarter = st.integers(0, 3).map(lambda k: k * math.pi / 2)
    yaw = st.builds(lambda q, d: q + d, quarter, st.sampled_from((-0.3, 0.0, 0.2)))
    step = st.builds(
        Step,
        st.sampled_from(KINDS),
        st.integers(0, 11),
        st.integers(0, len(PLACES) - 1),
        yaw,
        st.sampled_from((-0.15, 0.0, 0.1)),
        st.integers(0, 3),
    )
    return bounds, draw(st.lists(step, min_size=4, max_size=24))


def advance(walk: Walk, step: Step) -> None:
    """Does one step of a walk; a backtrack without anywhere to go is a wait."""
    kind, which, place, yaw, shift, seen = step
    direction = DIRECTIONS[which % 4]
    offers = walk.state.second_chance.offers
    if kind.startswith("back") and not offers:
        kind = "wait"
    goal = offers[which % len(offers)] if offers else 0
    if kind == "turn":
        walk.turn(direction, place, yaw=yaw, shift=shift, seen=seen)
    elif kind == "stuck":
        walk.turn(direction, place, yaw=yaw, shift=shift, seen=seen, reason="stuck")
    elif kind == "in vain":
        walk.turn_in_vain(direction)
    elif kind == "to here":
        walk.turn_to_here(direction)
    elif kind == "back":
        walk.back(goal, yaw=yaw, shift=4 * shift)
    elif kind == "back stuck":
        walk.back_stuck(goal, place, yaw=yaw)
    elif kind == "back in vain":
        walk.back_in_vain(goal)
    elif kind == "back to nothing":
        walk.back_in_vain(99)
    else:
        walk.wait()


def checked(examples: int) -> settings:
    # A walk that fails is not made shorter: that takes minutes, and each step has its meaning.
    return settings(
        derandomize=True, deadline=None, max_examples=examples, phases=(Phase.generate,)
    )


@given(plans())
@checked(200)
def test_the_buffer_and_what_it_offers(plan: Plan) -> None:
    bounds, steps = plan
    walk = Walk(bounds)
    walk.start()
    (start,) = walk.state.history.waypoints
    seen = {start.id: (start.position, start.heading, start.n)}
    for step in steps:
        highest = max(seen)
        advance(walk, step)
        history, chance = walk.state.history, walk.state.second_chance
        ids = [waypoint.id for waypoint in history.waypoints]
        assert len(ids) == len(set(ids)) <= bounds.waypoints
        assert history.waypoints[0].position == start.position
        assert ids[0] == start.id
        assert history.current in ids
        for waypoint in history.waypoints:
            known = (waypoint.position, waypoint.heading, waypoint.n)
            assert seen.setdefault(waypoint.id, known) == known
        assert all(number > highest for number in set(seen) - set(range(highest + 1)))
        assert set(chance.offers) == set(ids) - {history.current}
        assert len(chance.offers) == len(set(chance.offers))
        assert {edge.waypoint for edge in history.edges} <= set(ids)
        assert len(history.decisions) <= bounds.decisions
        assert (history.decisions[-1].n, history.decisions[-1].tool) == (
            walk.action.n, walk.action.tool,
        )  # fmt: skip
        assert history.n == chance.n == walk.panorama.n


@given(plans())
@checked(200)
def test_what_failed_stays_told_as_long_as_its_waypoint_is_remembered(plan: Plan) -> None:
    bounds, steps = plan
    walk = Walk(bounds)
    walk.start()
    for step in steps:
        advance(walk, step)
        remembered = {waypoint.id for waypoint in walk.state.history.waypoints}
        told = {(e.waypoint, e.n): e for e in walk.state.second_chance.failed_edges}
        legs = {(leg.waypoint, leg.n): leg for leg in walk.legs if leg.waypoint in remembered}
        assert set(told) == {key for key, leg in legs.items() if leg.failed}
        for key, edge in told.items():
            leg = legs[key]
            assert edge.outcome == (leg.outcome if not leg.given_up else "returned")
            assert math.remainder(edge.bearing - leg.bearing, 2 * math.pi) == pytest.approx(0.0)
        edges = {(e.waypoint, e.n) for e in walk.state.history.edges}
        assert edges == set(legs)


@given(plans())
@checked(200)
def test_a_second_chance_is_of_the_way_by_which_the_place_was_last_left(plan: Plan) -> None:
    bounds, steps = plan
    walk = Walk(bounds)
    walk.start()
    for step in steps:
        advance(walk, step)
        chance, told = walk.state.second_chance, walk.panorama.outcome
        if walk.action.tool != "backtrack" or told.state != "arrived":
            assert (chance.failed_direction, chance.failed_frames) == ("", ())
            continue
        assert walk.state.history.current == walk.action.waypoint
        leg = walk.last_leg(walk.state.history.current)
        if leg is None:
            assert (chance.failed_direction, chance.failed_frames) == ("", ())
            continue
        assert chance.failed_direction == word_of(leg.bearing, walk.panorama.yaw)
        frames = [picture.jpeg for picture in chance.failed_frames]
        numbers = [picture.number for picture in chance.failed_frames]
        seen = walk.pictures_of(leg)
        assert set(frames) <= seen
        assert numbers == sorted(set(numbers))
        assert len(frames) <= max(bounds.keyframes + 3, LEAST_OF_LEG)
        assert len(frames) >= min(len(seen), LEAST_OF_LEG)


@given(plans())
@checked(100)
def test_a_backtrack_that_does_not_arrive_gives_nothing_up_and_is_reported(plan: Plan) -> None:
    bounds, steps = plan
    walk = Walk(bounds)
    walk.start()
    for step in steps:
        before = walk.state
        advance(walk, step)
        if walk.action.tool != "backtrack" or walk.panorama.outcome.state == "arrived":
            continue
        after = walk.state
        remembered = {waypoint.id for waypoint in after.history.waypoints}
        kept = [e for e in before.history.edges if e.waypoint in remembered]
        assert [(e.waypoint, e.n, e.outcome) for e in after.history.edges] == [
            (e.waypoint, e.n, e.outcome) for e in kept
        ]
        record = after.history.decisions[-1]
        assert (record.tool, record.argument) == ("backtrack", str(walk.action.waypoint))
        assert record.outcome == f"failed: {walk.panorama.outcome.reason}"
        assert record.waypoint == before.history.current


def told(walk: Walk) -> list[tuple[int, str, str]]:
    """Returns the failed edges as waypoint, direction as it was then, outcome."""
    return [(e.waypoint, e.direction, e.outcome) for e in walk.state.second_chance.failed_edges]


def frames(walk: Walk) -> list[str]:
    return [picture.jpeg.decode() for picture in walk.state.second_chance.failed_frames]


BOUNDS = MemoryBounds(waypoints=6, decisions=4, keyframes=3, merge_distance=0.5)


def test_nested_and_repeated_backtracks_each_mark_their_own_way_and_all_are_told() -> None:
    walk = Walk(BOUNDS)
    walk.start()
    walk.turn("front", 1)
    walk.turn("left", 2)
    walk.back(2)
    assert walk.state.second_chance.failed_direction == "left"
    assert frames(walk) == ["way 2.0", "front 3"]
    assert told(walk) == [(2, "left", "returned")]
    # Again from the same place, elsewhere.
    walk.turn("right", 4, seen=2)
    walk.back(2)
    assert walk.state.second_chance.failed_direction == "right"
    assert frames(walk) == ["way 4.0", "way 4.1", "front 5"]
    assert told(walk) == [(2, "left", "returned"), (2, "right", "returned")]
    # And from there to an earlier one: its leg holds both.
    walk.back(1)
    assert walk.state.second_chance.failed_direction == "front"
    assert {"way 1.0", "front 2"} & set(frames(walk))
    assert frames(walk)[-1] == "front 5"
    assert len(frames(walk)) <= BOUNDS.keyframes + 3
    assert set(told(walk)) == {
        (1, "front", "returned"), (2, "left", "returned"), (2, "right", "returned"),
    }  # fmt: skip
    walk.turn("left", 3)
    walk.back(1)
    assert walk.state.second_chance.failed_direction == "left"
    assert frames(walk) == ["way 7.0", "front 8"]
    assert len(told(walk)) == 4


def test_a_way_tried_twice_is_told_twice() -> None:
    walk = Walk(BOUNDS)
    walk.start()
    for n in (1, 3):
        walk.turn("right", n)
        walk.back(1)
    assert told(walk) == [(1, "right", "returned")] * 2


def test_a_backtrack_that_got_stuck_half_way_may_be_tried_again() -> None:
    walk = Walk(BOUNDS)
    walk.start()
    walk.turn("front", 1)
    walk.back_stuck(1, 2)
    assert (walk.state.second_chance.failed_direction, told(walk)) == ("", [])
    assert walk.state.history.current == 3
    walk.back(1)
    assert walk.state.second_chance.failed_direction == "front"
    assert told(walk) == [(1, "front", "returned")]


def test_what_failed_from_a_place_is_told_again_when_the_robot_comes_there_again() -> None:
    walk = Walk(MemoryBounds(waypoints=3, decisions=4, keyframes=3, merge_distance=0.5))
    walk.start()
    walk.turn("front", 1)
    walk.turn("left", 2)
    walk.back(2)
    # The second place is the oldest but the start, and the robot leaves it for a new one.
    walk.turn("right", 3)
    assert [waypoint.id for waypoint in walk.state.history.waypoints] == [1, 3, 4]
    assert {edge.waypoint for edge in walk.state.history.edges} == {1}
    assert told(walk) == []
    walk.turn("back", 1)
    assert walk.state.history.current == 5
    assert told(walk) == [(5, "left", "returned")]


@pytest.mark.parametrize("choice", ["turn_in_vain", "turn_to_here"])
def test_a_choice_with_which_the_robot_did_not_leave_is_no_way_that_failed(choice: str) -> None:
    walk = Walk(BOUNDS)
    walk.start()
    walk.turn("front", 1)
    getattr(walk, choice)("left")
    walk.back(1)
    walk.turn("right", 2)
    walk.back(2)
    # The second place was only ever left by driving back.
    assert walk.state.second_chance.failed_direction == ""
    assert frames(walk) == []


def test_pictures_of_another_way_taken_since_are_not_those_of_the_failed_one() -> None:
    walk = Walk(BOUNDS)
    walk.start()
    walk.turn("front", 1)
    walk.turn("left", 2)
    walk.back(2)
    walk.back(1)
    walk.turn("right", 4)
    walk.back(2)
    assert walk.state.second_chance.failed_direction == "left"
    assert frames(walk) == ["way 2.0", "front 3"]
