"""The waypoint memory as a pure function: places, edges, second chances."""

from __future__ import annotations

import math

import numpy as np
import pytest

from unilavira_drake.memory.waypoints import (
    MemoryBounds,
    Sight,
    WaypointState,
    remember,
    with_picture,
)
from unilavira_drake.messages import (
    ON_THE_WAY,
    KeyPicture,
    LanguageAction,
    Outcome,
    Panorama,
    VisionAction,
)

NOTHING = LanguageAction()
BOUNDS = MemoryBounds(waypoints=4, decisions=3, keyframes=8, merge_distance=0.5)


def panorama(n: int, x: float, y: float, yaw: float = 0.0, **fields: object) -> Panorama:
    X_WB = np.eye(4)
    c, s = math.cos(yaw), math.sin(yaw)
    X_WB[:2, :2] = [[c, -s], [s, c]]
    X_WB[:2, 3] = x, y
    return Panorama(n=n, first=fields.pop("first", n), X_WB=X_WB, **fields)  # type: ignore[arg-type]


def turn(n: int, direction: str, scene: str = "") -> LanguageAction:
    return LanguageAction(n=n, call="decide", tool="turn", direction=direction, scene=scene)


def step(
    state: WaypointState,
    view: Panorama,
    action: LanguageAction = NOTHING,
    target: str = "",
) -> WaypointState:
    vision = VisionAction(n=action.n, target_desc=target)
    return remember(state, view, action, vision, sight(f"front {view.n}"), BOUNDS)


def sight(words: str) -> Sight:
    """Returns a picture that looks like no other: its look is noise drawn from its words."""
    generator = np.random.default_rng(list(words.encode()))
    return Sight(words.encode(), generator.integers(0, 256, 768, np.uint8).tobytes())


def on_the_way(state: WaypointState, action: LanguageAction, *words: str) -> WaypointState:
    for word in words:
        state = with_picture(
            state,
            sight(word),
            n=action.n,
            waypoint=state.history.current,
            direction=action.direction,
        )
    return state


def shown(pictures: tuple[KeyPicture, ...]) -> list[str]:
    return [f"{picture.number} {picture.jpeg.decode()}" for picture in pictures]


def test_first_panorama_makes_the_first_waypoint() -> None:
    state = step(WaypointState(), panorama(1, 2.0, 3.0, yaw=0.5))
    (waypoint,) = state.history.waypoints
    assert (waypoint.id, waypoint.n, waypoint.position[:2]) == (1, 1, (2.0, 3.0))
    assert waypoint.heading == pytest.approx(0.5)
    assert state.history.n == state.second_chance.n == 1
    assert state.second_chance.offers == ()


def test_edge_caption_and_offer_of_a_drive() -> None:
    state = step(WaypointState(), panorama(1, 0, 0, yaw=1.0))
    state = step(state, panorama(2, 0, 4), turn(1, "left", scene="a bedroom"), target="white door")
    assert [w.caption for w in state.history.waypoints] == [("", "a bedroom"), ("white door", "")]
    (edge,) = state.history.edges
    assert (edge.waypoint, edge.direction, edge.to, edge.outcome) == (1, "left", 2, "arrived")
    assert edge.bearing == pytest.approx(1.0 + math.pi / 2)
    assert state.second_chance.offers == (1,)
    assert state.history.decisions[-1].target_desc == "white door"


@pytest.mark.parametrize(
    ("outcome", "edge", "told"),
    [
        (Outcome("arrived", "", 0.72), "arrived", "arrived, 0.7 m from it"),
        (
            Outcome("arrived", "", 7.7, -6.52),
            "arrived",
            "arrived, 7.7 m from it (it is 6.5 m lower)",
        ),
        (
            Outcome("arrived", ON_THE_WAY, 31.0, 12.0),
            ON_THE_WAY,
            "on the way, 31.0 m from it (it is 12.0 m higher)",
        ),
        (Outcome("arrived", ON_THE_WAY), ON_THE_WAY, "on the way, too far to measure"),
    ],
)
def test_it_is_told_how_far_the_mark_still_is(outcome: Outcome, edge: str, told: str) -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = step(state, panorama(2, 40, 0, outcome=outcome), turn(1, "front"), target="a boat")
    assert [(e.outcome, e.to, e.arrived, e.failed) for e in state.history.edges] == [
        (edge, 2, True, False)
    ]
    assert state.history.decisions[-1].outcome == told
    # What was flown by numbers has no mark.
    flown = LanguageAction(n=1, call="decide", tool="fly", distance=40.0)
    state = step(
        step(WaypointState(), panorama(1, 0, 0)), panorama(2, 40, 0, outcome=outcome), flown
    )
    assert state.history.decisions[-1].outcome == edge


def test_near_place_is_the_same_waypoint() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = step(state, panorama(2, 3, 0), turn(1, "front"))
    state = step(state, panorama(3, 0.3, 0.2), turn(2, "back"))
    assert state.history.current == 1
    assert len(state.history.waypoints) == 2


def test_reissued_panorama_adds_nothing_but_a_failed_edge() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    blocked = panorama(2, 0, 0, first=1, outcome=Outcome("failed", "unreachable"))
    state = step(state, blocked, turn(1, "right"))
    assert len(state.history.waypoints) == 1
    (edge,) = state.second_chance.failed_edges
    assert (edge.waypoint, edge.direction, edge.to) == (1, "right", None)
    assert edge.outcome == "failed: unreachable"


def test_arrived_backtrack_names_the_failed_direction_and_its_pictures() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = on_the_way(state, turn(1, "front"), "leg 1")
    state = step(state, panorama(2, 3, 0), turn(1, "front"))
    state = on_the_way(state, turn(2, "left"), "leg 2a", "leg 2b")
    state = step(state, panorama(3, 3, 3), turn(2, "left"))
    back = LanguageAction(n=3, call="decide", tool="backtrack", waypoint=2)
    state = step(state, panorama(4, 3, 0), back)
    chance = state.second_chance
    assert chance.failed_direction == "left"
    assert shown(chance.failed_frames) == ["4 leg 2a", "5 leg 2b", "6 front 3"]
    assert [e.outcome for e in chance.failed_edges] == ["returned"]
    assert state.history.current == 2
    assert [p.label for p in state.history.keyframes] == [
        "H1: front view at waypoint 1",
        "H2: leaving waypoint 1 by its front view",
        "H3: front view at waypoint 2",
        "H4: leaving waypoint 2 by its left view",
        "H5: leaving waypoint 2 by its left view",
        "H6: front view at waypoint 3",
    ]


def test_what_is_seen_now_is_no_picture_of_the_past() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    assert state.history.keyframes == ()
    state = step(state, panorama(2, 0, 0, first=1), turn(1, "right"))
    assert state.history.keyframes == ()
    state = step(state, panorama(3, 3, 0), turn(2, "front"))
    assert shown(state.history.keyframes) == ["1 front 1"]
    assert [w.picture for w in state.history.waypoints] == [1, 2]


def test_a_view_like_the_latest_picture_is_not_kept_and_stands_for_its_place() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = on_the_way(state, turn(1, "front"), "hall", "hall")
    like = remember(
        state, panorama(2, 3, 0), turn(1, "front"), VisionAction(), sight("hall"), BOUNDS
    )
    assert shown(like.history.keyframes) == ["1 front 1", "2 hall"]
    assert [w.picture for w in like.history.waypoints] == [1, 2]


def test_the_history_grows_at_its_end_and_loses_four_at_once() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    numbers: list[int] = []
    for n in range(2, 40):
        state = step(state, panorama(n, 3.0 * n, 0), turn(n - 1, "front"))
        now = [picture.number for picture in state.history.keyframes]
        assert now == list(range(now[0], n))
        assert len(now) == n - 1 if n <= 12 else 8 <= len(now) <= 11
        if numbers:
            dropped = now[0] - numbers[0]
            assert dropped in (0, 4)
            assert now[: len(numbers) - dropped] == numbers[dropped:]
        numbers = now


def test_failed_direction_is_told_in_the_words_of_the_present_panorama() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = step(state, panorama(2, 3, 0), turn(1, "front"))
    back = LanguageAction(n=2, call="decide", tool="backtrack", waypoint=1)
    state = step(state, panorama(3, 0, 0, yaw=math.pi / 2), back)
    assert state.second_chance.failed_direction == "right"


def test_backtrack_that_did_not_arrive_marks_no_edge() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = step(state, panorama(2, 3, 0), turn(1, "front"))
    back = LanguageAction(n=2, call="decide", tool="backtrack", waypoint=1)
    state = step(state, panorama(3, 2, 0, outcome=Outcome("failed", "stuck")), back)
    assert state.second_chance.failed_direction == ""
    assert state.second_chance.failed_edges == ()


def test_buffer_is_bounded_and_keeps_the_start() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    for n in range(2, 8):
        state = step(state, panorama(n, 3.0 * n, 0), turn(n - 1, "front"))
    assert [w.id for w in state.history.waypoints] == [1, 5, 6, 7]
    assert len(state.history.decisions) == BOUNDS.decisions


def test_caption_is_at_most_160_characters() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = step(state, panorama(2, 3, 0), turn(1, "front", scene="x" * 400))
    assert len("".join(state.history.waypoints[0].caption)) <= 160


def test_a_way_that_got_stuck_half_way_is_the_one_that_failed() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = step(state, panorama(2, 3, 0), turn(1, "left"))
    back = LanguageAction(n=2, call="decide", tool="backtrack", waypoint=1)
    state = step(state, panorama(3, 0, 0), back)
    assert state.second_chance.failed_direction == "left"
    state = on_the_way(state, turn(3, "right"), "to the right")
    stuck = panorama(4, 2, -2, outcome=Outcome("failed", "stuck"))
    state = step(state, stuck, turn(3, "right"))
    back = LanguageAction(n=4, call="decide", tool="backtrack", waypoint=1)
    state = step(state, panorama(5, 0, 0), back)
    assert state.second_chance.failed_direction == "right"
    assert shown(state.second_chance.failed_frames) == ["3 to the right", "4 front 4"]
    assert [e.outcome for e in state.history.edges] == ["returned", "failed: stuck"]


def test_an_arrived_backtrack_is_at_its_waypoint_even_if_the_goal_moved_a_little() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    state = step(state, panorama(2, 3, 0), turn(1, "front"))
    back = LanguageAction(n=2, call="decide", tool="backtrack", waypoint=1)
    state = step(state, panorama(3, 0.7, 0), back)
    assert state.history.current == 1
    assert state.second_chance.failed_direction == "front"


def test_edges_of_evicted_waypoints_are_forgotten() -> None:
    state = step(WaypointState(), panorama(1, 0, 0))
    for n in range(2, 12):
        state = step(state, panorama(n, 3.0 * n, 0), turn(n - 1, "front"))
    kept = {w.id for w in state.history.waypoints}
    assert {e.waypoint for e in state.history.edges} <= kept
