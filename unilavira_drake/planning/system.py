"""The planner: snaps goals, plans and replans, and says how the robot's way ends."""

from __future__ import annotations

import dataclasses as dc
import math
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from unilavira_drake.messages import (
    ALREADY_THERE,
    STAIR_KINDS,
    Goal,
    Message,
    NavigationStatus,
    OccupancyMap,
    Path,
)
from unilavira_drake.planning.navigation_grid import path_is_blocked
from unilavira_drake.planning.plan import Plan, PlanningParameters, make_plan, warm_up
from unilavira_drake.planning.polyline import final_heading, remaining_length
from unilavira_drake.planning.stairs import CLIMB_SPEED, Climb
from unilavira_drake.ports import Level, message_input, pose_input

PROGRESS = 0.05
"""The way that remains must shrink by this much to count as progress, metres."""

BACK_OFF = 0.4
"""A robot that is stuck backs off this far, metres, ..."""

BACK_OFF_TIME = 5.0
"""... or for as long, seconds; what is behind it may be in the way, too."""

MOST_RECOVERIES = 1

BUDGET_BASE = 3.0
"""Travel that is always granted beyond the planned length times the travel factor, metres."""

FINAL_STRETCH = 0.75
"""Nearer to the goal than this only a blocked way is planned anew, metres."""

DETOUR = 2.0
"""A way that is so much longer than the one that is blocked is worth waiting for, metres."""
CANNOT_CLIMB = "this robot cannot climb stairs"

Point = tuple[float, float]


@dc.dataclass(frozen=True)
class PlannerState(Message):
    """Status and path of one goal, and what it takes to watch its progress."""

    status: NavigationStatus = NavigationStatus()
    path: Path = Path()
    heading: float | None = None
    target: Point = (0.0, 0.0)
    """The selected point before snapping, metres."""
    viewpoint: Point = (0.0, 0.0)
    """Where the robot was when the goal was given, metres."""
    map_version: int = 0
    """Version of the map of the latest plan."""
    checked_version: int = 0
    """Version of the map against which the path was last checked."""
    plan_time: float = 0.0
    progress_time: float = 0.0
    least_remaining: float = math.inf
    position: Point = (0.0, 0.0)
    """Where travel was last added up, metres."""
    travelled: float = 0.0
    budget: float = 0.0
    blocked_since: float = math.inf
    """Since when there is no way any more, seconds; inf while there is one, also the old one."""
    climb: Climb | None = None
    """Of a goal over stairs."""
    recoveries: int = 0
    """How often the robot has backed off on the way to this goal."""


class FastMarchingPlanner(Level):
    """Plans on free floor to each goal and reports ``arrived`` or ``failed`` with the reason.

    Goal n is taken up once the map holds panorama n.  While the robot moves, the way is planned
    anew when a new map blocks it, or when the map changed, the plan is ``replan_period`` old and
    the goal is not near.  A robot arrives facing the way it came, whatever its last small
    correction was, unless the goal names a heading.  A terminal status and the empty path are
    views of one state.

    A robot that is stuck backs off once for each goal: a short path straight back, gone backwards;
    then the way is planned anew, to which it turns.  Stuck again, it fails.

    Reasons of failure: the goal's own, ``unreachable``, ``no free space
    within ... m``, ``stuck``, ``travel budget``.

    Over stairs (``climb``, ``descend``) the robot drives to their foot first, then straight and
    slowly over them until the floor is level a storey higher or lower.

    .. pydrake_system::

        name: FastMarchingPlanner
        input_ports:
        - map
        - pose_estimate
        - goal
        output_ports:
        - path
        - navigation_status

    Args:
        radius: radius kept free around the base's centre, metres.
        turning_radius: radius swept when the base turns in place, metres.
        snap_distance: a goal moves at most this far to free floor, metres.
        tolerance: arrived within this distance of the snapped goal, metres.
        stuck_time: stuck after this long without progress, seconds.
        travel_factor: fails after this many times the planned length plus 3 m.
        can_climb: whether the robot can take stairs.
        replan_period: seconds between two plans while nothing blocks the way.
        patience: where the way is blocked on the drive, and there is none or a long one only, it
            waits so many seconds: for places where people walk.
        period: seconds between two polls.
    """

    def __init__(
        self,
        *,
        radius: float = 0.36,
        turning_radius: float = 0.50,
        snap_distance: float = 1.5,
        tolerance: float = 0.15,
        stuck_time: float = 6.0,
        travel_factor: float = 3.0,
        can_climb: bool = False,
        replan_period: float = 1.0,
        patience: float = 0.0,
        period: float = 0.1,
    ) -> None:
        super().__init__(PlannerState(), period=period)
        self._parameters = PlanningParameters(radius, turning_radius, snap_distance)
        self._tolerance = tolerance
        self._stuck_time = stuck_time
        self._travel_factor = travel_factor
        self._can_climb = can_climb
        self._replan_period = replan_period
        self._patience = patience
        self._map = message_input(self, "map", OccupancyMap())
        self._pose = pose_input(self, "pose_estimate")
        self._goal = message_input(self, "goal", Goal())
        self.declare_output("path", lambda state: state.path, Path())
        self.declare_output("navigation_status", lambda state: state.status, NavigationStatus())
        warm_up()

    def step(self, context: Context, state: Any) -> Any:
        """Returns the state after a new goal, a new map or some way driven; see the class."""
        time = context.get_time()
        if not state.status.terminal:
            return self._go_on(context, state, time)
        goal = self._goal(context)
        if goal.n <= state.status.n:
            return state
        occupancy = self._map(context)
        if occupancy.n < goal.n:
            return state
        if goal.kind == "stay":
            return _done(goal.n, "arrived", "", goal.heading)
        if goal.kind in STAIR_KINDS.values() and not self._can_climb:
            return _done(goal.n, "failed", CANNOT_CLIMB, None)
        if goal.kind not in ("go", *STAIR_KINDS.values()) or goal.p_WG is None:
            return _done(goal.n, "failed", goal.reason, None)
        state = self._begin(goal, occupancy, self._position(context), time)
        return self._set_off(context, state, time)

    def _go_on(self, context: Context, state: PlannerState, time: float) -> PlannerState:
        position = self._position(context)
        if state.climb is None or not state.climb.begun:
            occupancy = self._map(context)
            if state.path.backwards:
                after = self._back_off(state, occupancy, position, time)
            else:
                after = self._follow(context, state, occupancy, time)
            # The end of the way to the foot is forgotten with its goal.
            after = after if state.climb is None else dc.replace(after, climb=state.climb)
            return self._set_off(context, after, time)
        z = float(self._pose(context).translation()[2])
        climb = state.climb.at(position, z, time)
        verdict, reason = climb.verdict(self._stuck_time, time)
        if verdict == "moving":
            return dc.replace(state, climb=climb) if climb != state.climb else state
        return _done(state.status.n, verdict, reason, climb.heading)

    def _set_off(self, context: Context, state: PlannerState, time: float) -> PlannerState:
        """Begins the stairs of a robot that has come to their foot; others stay as they are."""
        n, climb = state.status.n, state.climb
        if climb is None or state.status.state != "arrived":
            return state
        position = self._position(context)
        z = float(self._pose(context).translation()[2])
        path = Path(n, state.path.version + 1, climb.path(position), CLIMB_SPEED)
        return PlannerState(
            status=NavigationStatus(n, "moving"),
            path=path,
            position=position,
            climb=climb.set_off(position, z, time),
        )

    def _position(self, context: Context) -> Point:
        x, y, _ = self._pose(context).translation()
        return (float(x), float(y))

    def _begin(
        self, goal: Goal, occupancy: OccupancyMap, position: Point, time: float
    ) -> PlannerState:
        assert goal.p_WG is not None
        climb = Climb.of(goal) if goal.kind in STAIR_KINDS.values() else None
        target = goal.p_WG[:2] if climb is None else climb.approach(self._parameters.radius)
        fresh = PlannerState(
            status=NavigationStatus(goal.n, "moving"),
            heading=goal.heading,
            target=target,
            viewpoint=position,
            progress_time=time,
            position=position,
        )
        plan = make_plan(
            occupancy,
            position=position,
            target=fresh.target,
            viewpoint=position,
            parameters=self._parameters,
        )
        return dc.replace(self._planned(fresh, plan, occupancy, time), climb=climb)

    def _planned(
        self, state: PlannerState, plan: Plan, occupancy: OccupancyMap, time: float
    ) -> PlannerState:
        n = state.status.n
        if plan.reason:
            return _done(n, "failed", plan.reason, None)
        if plan.length <= self._tolerance:
            reason = "" if state.path.n == n else ALREADY_THERE
            left = math.dist(state.position, state.target)
            return _done(n, "arrived", reason, state.heading, left)
        version = state.path.version + 1 if state.path.n == n else 0
        return dc.replace(
            state,
            path=Path(n, version, plan.p_WP),
            map_version=occupancy.version,
            checked_version=occupancy.version,
            plan_time=time,
            # Not the time of progress: replanning alone must not hide that the robot is stuck.
            least_remaining=plan.length,
            budget=max(state.budget, self._travel_factor * plan.length + BUDGET_BASE),
        )

    def _recover(self, context: Context, state: PlannerState, time: float) -> PlannerState:
        """Returns the state with a way straight back from where the robot is stuck."""
        R_WB = self._pose(context).rotation().matrix()
        ahead = math.atan2(R_WB[1, 0], R_WB[0, 0])
        x, y = self._position(context)
        back = (x - BACK_OFF * math.cos(ahead), y - BACK_OFF * math.sin(ahead))
        path = Path(state.path.n, state.path.version + 1, np.array([(x, y), back]), backwards=True)
        return dc.replace(
            state, path=path, plan_time=time, progress_time=time, recoveries=state.recoveries + 1
        )

    def _back_off(
        self, state: PlannerState, occupancy: OccupancyMap, position: Point, time: float
    ) -> PlannerState:
        """Returns the state with a new plan once the robot has backed off."""
        x, y = state.path.p_WP[-1].tolist()
        there = math.dist(position, (x, y)) <= self._tolerance
        if not there and time - state.plan_time < BACK_OFF_TIME:
            return state
        plan = make_plan(
            occupancy,
            position=position,
            target=state.target,
            viewpoint=state.viewpoint,
            parameters=self._parameters,
        )
        return self._planned(dc.replace(state, progress_time=time), plan, occupancy, time)

    def _follow(
        self, context: Context, state: PlannerState, occupancy: OccupancyMap, time: float
    ) -> PlannerState:
        position = self._position(context)
        points = state.path.p_WP
        goal = (float(points[-1, 0]), float(points[-1, 1]))
        left = math.dist(position, state.target)
        if math.dist(position, goal) <= self._tolerance:
            heading = final_heading(points) if state.heading is None else state.heading
            return _done(state.status.n, "arrived", "", heading, left)
        step = math.dist(position, state.position)
        if step >= PROGRESS:
            travelled = state.travelled + step
            state = dc.replace(state, travelled=travelled, position=position)
        if state.travelled > state.budget:
            return _done(state.status.n, "failed", "travel budget", None, left)
        remaining = remaining_length(points, *position)
        if remaining <= state.least_remaining - PROGRESS:
            state = dc.replace(state, least_remaining=remaining, progress_time=time)
        elif time - state.progress_time > self._stuck_time:
            if state.recoveries < MOST_RECOVERIES and all(map(math.isfinite, position)):
                return self._recover(context, state, time)
            return _done(state.status.n, "failed", "stuck", None, left)
        return self._replanned(state, occupancy, position, goal, time)

    def _replanned(
        self,
        state: PlannerState,
        occupancy: OccupancyMap,
        position: Point,
        goal: Point,
        time: float,
    ) -> PlannerState:
        due = time - state.plan_time >= self._replan_period - 1e-9
        # A new plan over the last stretch could only shake the heading of the arrival.
        due = due and math.dist(position, goal) > FINAL_STRETCH
        if occupancy.version == state.map_version or (
            occupancy.version == state.checked_version and not due
        ):
            return state
        if not due and not path_is_blocked(
            occupancy, state.path.p_WP, position=position, radius=self._parameters.radius
        ):
            return dc.replace(state, checked_version=occupancy.version, blocked_since=math.inf)
        plan = make_plan(
            occupancy,
            position=position,
            target=state.target,
            viewpoint=state.viewpoint,
            goal=goal,
            parameters=self._parameters,
        )
        detour = plan.length - remaining_length(state.path.p_WP, *position)
        if self._patience > 0.0 and (plan.reason or detour > DETOUR):
            since = min(state.blocked_since, time)
            if time - since < self._patience:
                # The old way stands, and the governor holds the robot on it.
                return dc.replace(
                    state,
                    checked_version=occupancy.version,
                    blocked_since=since,
                    progress_time=time,
                )
        return self._planned(dc.replace(state, blocked_since=math.inf), plan, occupancy, time)


def _done(
    n: int, state: str, reason: str, heading: float | None, remaining: float | None = None
) -> PlannerState:
    """Returns the terminal state of goal n: its status and the empty path, in one message."""
    status = NavigationStatus(n, state, reason, heading, remaining)
    return PlannerState(status=status, path=Path(n))
