"""The agent's pure parts around a model, with a robot that jumps to its goals.

Everything but motion is the real thing: prompt variables, detector, reply parsers, TODO list,
waypoints and goal selection.  The robot takes the shortest way over the true free floor.
"""

import dataclasses
import functools
import math

import numpy as np
from raycast_views import Caster
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from unilavira_drake.errors import ReplyFormatError
from unilavira_drake.language.next_call import next_call
from unilavira_drake.language.reply import parse_language_reply
from unilavira_drake.language.variables import language_request
from unilavira_drake.mapping.goal_selector import select_goal
from unilavira_drake.memory.todo import apply_updates
from unilavira_drake.memory.waypoints import MemoryBounds, Sight, WaypointState, remember
from unilavira_drake.messages import LanguageAction, Outcome, TodoList, VisionAction
from unilavira_drake.mllm.request import MllmRequest, VisionVariables
from unilavira_drake.sensors.detections import GroundTruthDetector
from unilavira_drake.sensors.free_distance import free_distance
from unilavira_drake.tasks import TaskSpec
from unilavira_drake.vision.reply import parse_vision_reply
from unilavira_drake.worlds.clearance import clearance
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.start import parse_start

STEP = 0.1
RADIUS = 0.36
ROOMY = 0.50
BOUNDS = MemoryBounds(32, 8, 6, 0.5)


@dataclasses.dataclass(frozen=True)
class Decision:
    request: MllmRequest
    reply: str
    action: LanguageAction
    vision: VisionAction
    pose: tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Run:
    decisions: tuple[Decision, ...]
    todo: TodoList
    pose: tuple[float, float, float]
    panorama: object
    stopped: bool
    answer: str

    @property
    def tools(self):
        return [d.action.tool for d in self.decisions]


class Home:
    """A world, its pictures and its free floor."""

    def __init__(self, name="flat", mirror=False):
        self.world = load_world(name, mirror=mirror)
        self.caster = Caster(self.world)
        low = np.min([room.rectangle[:2] for room in self.world.rooms], axis=0)
        high = np.max([room.rectangle[2:] for room in self.world.rooms], axis=0)
        columns, rows = np.ceil((high - low) / STEP).astype(int)
        x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
        self.points = low + STEP * np.stack((x, y), axis=-1).reshape(-1, 2)
        self.room = clearance(self.world, self.points)
        self.graph = _graph(self.room >= RADIUS, rows, columns)

    def drive(self, pose, goal, heading=None, snap=1.5):
        """Returns the pose after driving to a goal, or None where it cannot be reached."""
        start = int(np.argmin(np.hypot(*(self.points - pose[:2]).T) + 9.0 * (self.room < RADIUS)))
        reach, back = dijkstra(self.graph, indices=start, return_predecessors=True)
        off = np.hypot(*(self.points - np.array(goal)).T)
        # A camera sees no floor behind a wall, so no goal moves into another room than the seen.
        room = self.world.room_at(*goal)
        allowed = np.isfinite(reach) & (off <= snap)
        if room is not None:
            allowed &= (self.points >= room.rectangle[:2]).all(axis=1)
            allowed &= (self.points <= room.rectangle[2:]).all(axis=1)
        if not allowed.any():
            return None
        roomy = allowed & (self.room >= ROOMY) & (off <= off[allowed].min() + 0.3)
        end = int(np.argmin(np.where(roomy if roomy.any() else allowed, off, np.inf)))
        way = [end]
        while back[way[-1]] >= 0:
            way.append(back[way[-1]])
        x, y = self.points[end]
        if len(way) == 1:
            return (pose[0], pose[1], pose[2])
        before = self.points[way[min(5, len(way) - 1)]]
        yaw = math.atan2(y - before[1], x - before[0]) if heading is None else heading
        return float(x), float(y), yaw


def _graph(free, rows, columns):
    index = np.arange(rows * columns).reshape(rows, columns)
    free = free.reshape(rows, columns)
    edges = []
    for di, dj in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = index[: rows - di, max(0, -dj) : columns - max(0, dj)]
        b = index[di:, max(0, dj) : columns + min(0, dj)]
        both = free.ravel()[a] & free.ravel()[b]
        edges.append((a[both], b[both], np.full(both.sum(), math.hypot(di, dj) * STEP)))
    a, b, length = (np.concatenate(part) for part in zip(*edges, strict=True))
    size = rows * columns
    return csr_matrix((np.r_[length, length], (np.r_[a, b], np.r_[b, a])), shape=(size, size))


def run(
    home, model, text, start, *, family="vln", todo=True, scb=True, seed=0, budget=40, labels=None
):
    """Runs one task to its end or to the budget of decisions."""
    measure = functools.partial(free_distance, min_height=0.1, max_height=1.4)
    detector = GroundTruthDetector(labels or home.world.labels)
    pose = parse_start(start, home.world, radius=RADIUS)
    state, items = WaypointState(), TodoList()
    action, vision, outcome = LanguageAction(), VisionAction(), Outcome()
    decisions, panorama, moved = [], None, True
    for n in range(1, budget + 1):
        if moved:
            panorama = home.caster.panorama(n, *pose, outcome)
        else:
            panorama = dataclasses.replace(panorama, n=n, outcome=outcome)
        state = remember(state, panorama, action, vision, Sight(), BOUNDS)
        request = language_request(
            call=next_call(action, outcome, family=family, has_todo=todo),
            seed=seed, task=TaskSpec(family, text), panorama=panorama, history=state.history,
            second_chance=state.second_chance if scb else None, todo=items if todo else None,
            last_action=action, can_climb=False, free_distance=measure, detector=detector,
        )  # fmt: skip
        reply = model.complete(request).text
        action = parse_language_reply(reply, request)
        items = apply_updates(items, action)
        vision = VisionAction()
        if action.tool == "turn":
            vision = _ground(model, request, action, items if todo else None, panorama)
        decisions.append(Decision(request, reply, action, vision, pose))
        if action.tool == "stop":
            return Run(tuple(decisions), items, pose, panorama, True, action.answer)
        goal = select_goal(action, vision, state.history, panorama, max_range=10.0)
        new, outcome = pose, Outcome()
        if goal.kind == "none":
            outcome = Outcome("failed", goal.reason)
        elif goal.kind == "go":
            new = home.drive(pose, goal.p_WG[:2], goal.heading)
            if new is None:
                new, outcome = pose, Outcome("failed", "unreachable")
        moved = math.dist(pose[:2], new[:2]) > 0.05 or abs(pose[2] - new[2]) > 0.05
        pose = new
    return Run(tuple(decisions), items, pose, panorama, False, "")


def _ground(model, request, action, items, panorama):
    variables = VisionVariables(
        family=request.variables.family, task=request.variables.task,
        direction=action.direction, progress_analysis=action.progress_analysis,
        reasoning_action=action.reasoning_action, todo=None if items is None else items.items,
        width=panorama.frames[0].intrinsics.width, height=panorama.frames[0].intrinsics.height,
    )  # fmt: skip
    evidence = tuple(v for v in request.evidence if v.direction == action.direction)
    asked = MllmRequest(
        role="vision", n=request.n, seed=request.seed, call="ground", variables=variables,
        evidence=evidence,
    )  # fmt: skip
    try:
        return parse_vision_reply(model.complete(asked).text, asked)
    except ReplyFormatError as error:
        return VisionAction(n=action.n, direction=action.direction, reason=f"no target: {error}")
