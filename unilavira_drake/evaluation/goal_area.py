"""Where on the floor an episode succeeds, as outlines for pictures."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from unilavira_drake.evaluation.air_goal import AirGoal
from unilavira_drake.evaluation.free_space import in_rooms
from unilavira_drake.evaluation.scoring import HOME_RULE, GoalField
from unilavira_drake.tasks import SuccessRule


def success_area(goal: GoalField, rule: SuccessRule = HOME_RULE) -> tuple[NDArray[np.float64], ...]:
    """Returns the outlines, (k, 2) metres in the world, of the floor on which a stop succeeds.

    It is the free floor, of the goal's rooms if the rule asks for them, that is near enough to the
    goal; that the goal has to be in the last panorama cannot be drawn.  Of a flight it is what lies
    within the radius at the goal's own height.
    """
    if isinstance(goal, AirGoal):
        return goal.outlines(rule.radius)
    outlines: list[NDArray[np.float64]] = []
    for target, field in zip(goal.targets, goal.fields, strict=True):
        space = field.space
        near = field.times * space.resolution <= rule.radius
        rooms = target.rooms if rule.in_room else None
        mask = (near & in_rooms(space, goal.world, rooms, target.elevation)).astype(np.uint8)
        contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        for contour in contours:
            cells = cv2.approxPolyDP(contour, 1.0, True)[:, 0, :]
            if len(cells) >= 3:
                # Contours run through the centres of the outermost cells.
                outlines.append(np.array(space.origin) + (cells + 0.5) * space.resolution)
    return tuple(outlines)
