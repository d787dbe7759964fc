"""A small town of boxes seen from the air, and an aircraft that jumps to its goals.

Everything but motion is the real thing: prompt variables, detector, reply parsers, TODO list,
waypoints and goal selection.
"""

import dataclasses
import math
from types import SimpleNamespace

import numba
import numpy as np

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.language.next_call import next_call
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.language.variables import language_request
from unilavira_drake.mapping.goal_selector import select_goal
from unilavira_drake.memory.todo import apply_updates
from unilavira_drake.memory.waypoints import MemoryBounds, Sight, WaypointState, remember
from unilavira_drake.messages import (
    DIRECTIONS,
    DOWN,
    ON_THE_WAY,
    VIEW_YAW,
    Frame,
    LanguageAction,
    Outcome,
    Panorama,
    TodoList,
    VisionAction,
)
from unilavira_drake.mllm.request import MllmRequest, VisionVariables
from unilavira_drake.sensors.detections import GroundTruthDetector
from unilavira_drake.sensors.free_distance import axial_distance
from unilavira_drake.sensors.rig import pinhole
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.vision.reply import parse_vision_reply
from unilavira_drake.worlds.palette import PALETTE

LENS = pinhole(160, 120, 90.0)
RANGE = 40.0
BOUNDS = MemoryBounds(32, 8, 6, 0.5)
START = (0.0, 0.0, 12.0, 0.0)
# name, category, colour, centre, size; the ground's pieces lie over each other.
THINGS = (
    ("meadow", "meadow", "green", (100, 0, -0.5), (500, 400, 1.0)),
    ("road", "road", "gray", (80, 0, 0.01), (220, 8, 0.04)),
    ("park", "park", "green", (150, 60, 0.01), (60, 60, 0.04)),
    ("car", "car", "red", (60, 6, 0.75), (4, 2, 1.5)),
    ("bus", "bus", "yellow", (120, -7, 1.5), (10, 2.6, 3.0)),
    ("school", "school", "orange", (40, 30, 5), (20, 16, 10)),
    ("church", "church", "white", (100, -30, 9), (16, 12, 18)),
    ("house", "house", "brown", (20, -20, 3), (10, 10, 6)),
    ("block", "building", "gray", (150, 15, 12), (14, 14, 24)),
    ("fountain", "fountain", "white", (150, 60, 1), (4, 4, 2)),
    ("blue_car", "car", "blue", (172, 60, 0.75), (4, 2, 1.5)),
)
CENTERS = {name: np.array(center, float) for name, _, _, center, _ in THINGS}


class Town:
    """Draws the town."""

    def __init__(self):
        self._colors = (np.array([PALETTE[color] for _, _, color, _, _ in THINGS]) * 255).astype(
            np.uint8
        )
        self.labels = {
            i + 1: SimpleNamespace(category=category, instance=name, room_kind="")
            for i, (name, category, *_) in enumerate(THINGS)
        }

    def frame(self, view, x, y, z, yaw):
        X_WC = camera_pose(view, x, y, z, yaw)
        depth, index = cast(X_WC)
        hit = index >= 0
        label = np.where(hit, index + 1, 32766).astype(np.int16)
        color = np.where(hit[..., None], self._colors[index], 230).astype(np.uint8)
        depth = np.where(depth <= RANGE, depth, np.inf).astype(np.float32)
        return Frame(view=view, color=color, depth=depth, label=label, intrinsics=LENS, X_WC=X_WC)

    def panorama(self, n, x, y, z, yaw, outcome):
        frames = tuple(self.frame(view, x, y, z, yaw) for view in (*DIRECTIONS, DOWN))
        c, s = math.cos(yaw), math.sin(yaw)
        X_WB = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])
        return Panorama(n=n, first=n, X_WB=X_WB, frames=frames, outcome=outcome)

    def fly(self, pose, goal, heading):
        """Returns the pose at a goal, kept out of the things and 1 m above the ground."""
        x, y, z = goal
        for _, _, _, center, size in THINGS:
            inside = all(
                abs(p - c) < s / 2 + 0.5 for p, c, s in zip(goal[:2], center, size, strict=False)
            )
            if inside and z < center[2] + size[2] / 2 + 0.5:
                if size[2] > 2.0:
                    return None
                z = max(z, 1.5)
        moved = math.dist(pose[:2], (x, y)) > 0.5
        yaw = math.atan2(y - pose[1], x - pose[0]) if moved else pose[3]
        return x, y, z, yaw if heading is None else heading


BOUNDS_OF = np.array(
    [[np.array(c) - np.array(s) / 2, np.array(c) + np.array(s) / 2] for *_, c, s in THINGS]
)


def cast(X_WC):
    """Returns depth along the axis and the thing at each pixel (-1: none), as if in clear air."""
    pinhole_ = np.array([LENS.fx, LENS.fy, LENS.cx, LENS.cy])
    return _cast(BOUNDS_OF, X_WC, pinhole_, LENS.width, LENS.height)


@numba.njit(cache=True)
def _cast(bounds, X_WC, pinhole_, width, height):
    depth, index = np.full((height, width), np.inf), np.full((height, width), -1)
    for v in range(height):
        for u in range(width):
            x, y = (u - pinhole_[2]) / pinhole_[0], (v - pinhole_[3]) / pinhole_[1]
            for i in range(len(bounds)):
                near, far = 0.0, np.inf
                for axis in range(3):
                    q = X_WC[axis, 0] * x + X_WC[axis, 1] * y + X_WC[axis, 2]
                    q = q if abs(q) > 1e-9 else 1e-9
                    a = (bounds[i, 0, axis] - X_WC[axis, 3]) / q
                    b = (bounds[i, 1, axis] - X_WC[axis, 3]) / q
                    near, far = max(near, min(a, b)), min(far, max(a, b))
                if 0.0 < near <= far and near < depth[v, u]:
                    depth[v, u], index[v, u] = near, i
    return depth, index


def camera_pose(view, x, y, z, yaw):
    heading = yaw + VIEW_YAW.get(view, 0.0)
    c, s = math.cos(heading), math.sin(heading)
    forward = np.array([0.0, 0.0, -1.0]) if view == DOWN else np.array([c, s, 0.0])
    right = np.array([s, -c, 0.0])
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.stack((right, np.cross(forward, right), forward), axis=1)
    X_WC[:3, 3] = (x, y, z)
    return X_WC


@dataclasses.dataclass(frozen=True)
class Flight:
    """What happened: requests, actions, vision actions, poses."""

    steps: tuple
    pose: tuple
    stopped: bool
    todo: TodoList

    def away(self, name):
        return float(np.linalg.norm(np.array(self.pose[:3]) - CENTERS[name]))

    @property
    def tools(self):
        return [action.tool for _, action, _, _ in self.steps]


def run(town, model, text, *, start=START, todo=True, family="aerial_vln", budget=40):
    detector = GroundTruthDetector(town.labels, max_range=RANGE)
    pose, state, items = start, WaypointState(), TodoList()
    action, vision, outcome = LanguageAction(), VisionAction(), Outcome()
    steps, panorama, moved = [], None, True
    for n in range(1, budget + 1):
        if moved:
            panorama = town.panorama(n, *pose, outcome)
        else:
            panorama = dataclasses.replace(panorama, n=n, outcome=outcome)
        state = remember(state, panorama, action, vision, Sight(), BOUNDS)
        request = language_request(
            call=next_call(action, outcome, family=family, has_todo=todo),
            seed=0, task=TaskSpec(family, text), panorama=panorama, history=state.history,
            second_chance=state.second_chance, todo=items if todo else None,
            last_action=action, can_climb=False,
            free_distance=lambda frame: axial_distance(frame, max_range=RANGE), detector=detector,
        )  # fmt: skip
        action = parse_language_reply(model.complete(request).text, request)
        items = apply_updates(items, action)
        vision = VisionAction()
        if action.tool == "turn":
            vision = ground(model, request, action, items if todo else None)
        steps.append((request, action, vision, pose))
        if action.tool == "stop":
            return Flight(tuple(steps), pose, True, items)
        goal = select_goal(action, vision, state.history, panorama, max_range=RANGE)
        new, outcome = pose, Outcome()
        if goal.kind == "none":
            outcome = Outcome("failed", goal.reason)
        elif goal.kind == "go":
            new = town.fly(pose, goal.p_WG, goal.heading)
            outcome = Outcome("arrived", ON_THE_WAY if goal.partial else "")
            if new is None:
                new, outcome = pose, Outcome("failed", "unreachable")
        moved = math.dist(pose, new) > 0.05
        pose = new
    return Flight(tuple(steps), pose, False, items)


def ground(model, request, action, items):
    variables = VisionVariables(
        family=request.variables.family, task=request.variables.task,
        direction=action.direction, progress_analysis=action.progress_analysis,
        reasoning_action=action.reasoning_action, todo=None if items is None else items.items,
        width=LENS.width, height=LENS.height, in_flight=True,
    )  # fmt: skip
    evidence = tuple(v for v in request.evidence if v.direction == action.direction)
    asked = MllmRequest(
        role="vision", n=request.n, call="ground", variables=variables, evidence=evidence
    )
    try:
        return parse_vision_reply(model.complete(asked).text, asked)
    except ReplyFormatError as error:
        return VisionAction(n=action.n, direction=action.direction, reason=str(error))
