from __future__ import annotations

import cv2
import numpy as np
import pytest

from unilavira_drake.evaluation.goal_area import success_area
from unilavira_drake.evaluation.scoring import HOME_RULE, GoalField, make_goal_field
from unilavira_drake.tasks import SuccessRule, success_rule
from unilavira_drake.worlds.load import load_world

FLAT = load_world("flat")


@pytest.fixture(scope="module", params=["washing_machine_1", "study", "table_1|table_2"])
def goal(request: pytest.FixtureRequest) -> GoalField:
    return make_goal_field(request.param, FLAT, radius=0.36)


def test_the_area_is_where_a_stop_succeeds(goal: GoalField) -> None:
    outlines = [np.float32(outline) for outline in success_area(goal)]
    assert len(outlines) >= len(goal.targets)
    rooms = {name for target in goal.targets for name in target.rooms}
    random = np.random.default_rng(1)
    inside_count = 0
    for x, y in random.uniform((0.0, 0.0), (13.0, 10.0), (4000, 2)):
        margin = max(cv2.pointPolygonTest(outline, (x, y), True) for outline in outlines)
        # Outlines are drawn with a pen of a cell or two.
        if abs(margin) < 0.12 or not goal.fields[0].space.is_free(x, y):
            continue
        room = FLAT.room_at(x, y)
        succeeds = (
            room is not None
            and room.name in rooms
            and any(
                room.name in target.rooms and HOME_RULE.reached(distance)
                for target, distance in zip(goal.targets, goal.distances(x, y), strict=True)
            )
        )
        inside_count += succeeds
        assert succeeds == (margin > 0), (x, y, margin)
    assert inside_count > 30


def test_a_rule_without_a_room_widens_the_area_beyond_it() -> None:
    field = make_goal_field("study", FLAT, radius=0.36)

    def area(rule: SuccessRule) -> float:
        return sum(cv2.contourArea(np.float32(outline)) for outline in success_area(field, rule))

    home, wide = area(success_rule("vln")), area(success_rule("vln", "habitat"))
    assert wide > home + 1.0
