"""The flight planner: snaps goals, plans and replans in 3-D, and says how the flight ends."""

from __future__ import annotations

import dataclasses as dc
import math
from typing import Any

import numpy as np
from pydrake.systems.framework import Context

from unilavira_drake.messages import (
    ALREADY_THERE,
    ON_THE_WAY,
    Goal,
    NavigationStatus,
    Path,
    VoxelMap,
)
from unilavira_drake.planning.flight_recovery import (
    BACK_OFF_TIME,
    MOST_RECOVERIES,
    came_by,
    way_back,
)
from unilavira_drake.planning.polyline import final_heading
from unilavira_drake.planning.visibility import (
    FlightParameters,
    FlightPlan,
    Point,
    believable,
    warm_up,
)
from unilavira_drake.planning.visibility_narrow import (
    make_plan,
    near_a_gap,
    out_of_gaps,
    way_is_blocked,
)
from unilavira_drake.planning.visibility_narrow import warm_up as warm_up_gaps
from unilavira_drake.planning.visibility_path import remaining_way
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace, update_space
from unilavira_drake.planning.visibility_state import (
    VisibilityPlannerState,
    arrived,
    done,
    no_path,
)
from unilavira_drake.ports import Level, message_input, pose_input

AIRSPACE_ENDS = "the airspace ends here"
"""Why an arrival is not the end of the way: the goal lies beyond the geofence or the altitudes."""

PROGRESS = 0.1
"""The way that remains must shrink by this much to count as progress, metres."""

BUDGET_BASE = 10.0
"""Travel that is always granted beyond the planned length times the travel factor, metres."""

FINAL_STRETCH = 2.0
"""Nearer to the goal than this only a blocked way is planned anew, metres."""


class VisibilityPlanner(Level):
    """Plans through free space to each goal and reports ``arrived`` or ``failed`` with the reason.

    The first thing to fly is the way up to ``takeoff_altitude``; status 0 is ``moving`` until
    then.  Goal n is taken up once the map holds panorama n.  A goal beyond the geofence or the
    altitudes is moved to the nearest place within.  Unknown space is taken to be free.  While
    the aircraft moves, the way is planned anew when a new map blocks it, or when the map changed,
    the plan is ``replan_period`` old and the goal is not near.  ``path`` carries (k, 3) points.

    Where it cannot come with room to turn it is sent through gaps, straight and in their middle;
    ``path.narrow`` tells where.  In a gap, and just before it, only a blocked way is planned anew.

    An aircraft that is stuck backs off once for each goal, by the places that it came by and
    without turning; then the way is planned anew.  Stuck again, it fails.

    Reasons of failure: the goal's own, ``unreachable``, ``no free space within ... m``, ``no free
    space around the aircraft``, ``too many voxels to search``, ``farther than ... m``, ``stuck``,
    ``travel budget``, and numbers that are none.

    .. pydrake_system::

        name: VisibilityPlanner
        input_ports:
        - voxel_map
        - pose_estimate
        - goal
        output_ports:
        - path
        - navigation_status

    Args:
        radius: kept free around the aircraft's centre, metres.
        ground_margin: kept free below it, metres.
        ceiling_margin: kept free above it, metres.
        min_altitude: lowest z of its centre in the world, metres.
        max_altitude: highest z of its centre in the world, metres.
        geofence: x_min, y_min, x_max, y_max of its centre, metres; empty: none.
        takeoff_altitude: z to which it climbs before everything else, metres; None: it is in
            the air already.
        climb_angle: steepest path above the horizon, radians; pi / 2 is no limit.
        descend_angle: steepest path below the horizon, radians.
        snap_distance: a goal moves at most this far to free space, metres.
        max_distance: goals farther than this are refused, metres.
        narrow_radius: kept free beside the middle of a gap that is passed straight, metres; None:
            no gaps.
        tolerance: arrived within this distance of the snapped goal, metres.
        stuck_time: stuck after this long without progress, seconds.
        travel_factor: fails after this many times the planned length plus 10 m.
        replan_period: seconds between two plans while nothing blocks the way.
        period: seconds between two polls.

    Raises:
        ValueError: if a number makes no sense.
    """

    def __init__(
        self,
        *,
        radius: float = 0.5,
        ground_margin: float = 1.0,
        ceiling_margin: float = 0.5,
        min_altitude: float = 1.0,
        max_altitude: float = 60.0,
        geofence: tuple[float, ...] = (),
        takeoff_altitude: float | None = None,
        climb_angle: float = math.radians(45.0),
        descend_angle: float = math.radians(45.0),
        snap_distance: float = 3.0,
        max_distance: float = 200.0,
        narrow_radius: float | None = None,
        tolerance: float = 0.5,
        stuck_time: float = 6.0,
        travel_factor: float = 3.0,
        replan_period: float = 1.0,
        period: float = 0.1,
    ) -> None:
        self._parameters = FlightParameters(
            clearance=Clearance(radius, ground_margin, ceiling_margin),
            min_altitude=min_altitude,
            max_altitude=max_altitude,
            climb_angle=climb_angle,
            descend_angle=descend_angle,
            snap_distance=snap_distance,
            max_distance=max_distance,
            narrow_radius=narrow_radius,
        )
        space = FlightSpace(clearance=self._parameters.clearance)
        start = NavigationStatus(0, "arrived" if takeoff_altitude is None else "moving")
        initial = VisibilityPlannerState(start, no_path(0), space=space)
        super().__init__(initial, period=period)
        x_min, y_min, x_max, y_max = geofence or (-math.inf, -math.inf, math.inf, math.inf)
        self._fence = ((x_min, x_max), (y_min, y_max), (min_altitude, max_altitude))
        self._takeoff_altitude = takeoff_altitude
        self._tolerance = tolerance
        self._stuck_time = stuck_time
        self._travel_factor = travel_factor
        self._replan_period = replan_period
        self._map = message_input(self, "voxel_map", VoxelMap())
        self._pose = pose_input(self, "pose_estimate")
        self._goal = message_input(self, "goal", Goal())
        self.declare_output("path", lambda state: state.path, no_path(0))
        self.declare_output("navigation_status", lambda state: state.status, start)
        warm_up()
        warm_up_gaps()

    def step(self, context: Context, state: Any) -> Any:
        """Returns the state after a new goal, a new map or some way flown; see the class."""
        time = context.get_time()
        if not state.status.terminal and not len(state.path.p_WP):
            return self._take_off(state, self._map(context), self._position(context), time)
        if not state.status.terminal:
            go_on = self._back_off if state.path.backwards else self._follow
            return go_on(state, self._map(context), self._position(context), time)
        goal = self._goal(context)
        if goal.n <= state.status.n:
            return state
        voxels = self._map(context)
        if voxels.n < goal.n:
            return state
        if goal.kind == "stay":
            return done(state, goal.n, "arrived", "", goal.heading)
        if goal.kind != "go" or goal.p_WG is None:
            return done(state, goal.n, "failed", goal.reason, None)
        return self._begin(goal, state, voxels, self._position(context), time)

    def _position(self, context: Context) -> Point:
        x, y, z = self._pose(context).translation()
        return (float(x), float(y), float(z))

    def _take_off(
        self, state: VisibilityPlannerState, voxels: VoxelMap, position: Point, time: float
    ) -> VisibilityPlannerState:
        """Returns the state at the start of the flight: the way up is goal 0."""
        if not believable(position):
            return state
        assert self._takeoff_altitude is not None
        x, y, z = position
        up = Goal(0, "go", (x, y, max(z, self._takeoff_altitude)))
        return self._begin(up, state, voxels, position, time)

    def _begin(
        self,
        goal: Goal,
        state: VisibilityPlannerState,
        voxels: VoxelMap,
        position: Point,
        time: float,
    ) -> VisibilityPlannerState:
        assert goal.p_WG is not None
        if len(goal.p_WG) != 3:
            return done(state, goal.n, "failed", "the goal is not a point in space", None)
        x, y, z = (
            min(max(a, low), high) for a, (low, high) in zip(goal.p_WG, self._fence, strict=True)
        )
        beyond = math.dist((x, y, z), goal.p_WG) > self._tolerance
        fresh = VisibilityPlannerState(
            status=NavigationStatus(goal.n, "moving"),
            path=no_path(0),
            heading=goal.heading,
            target=(x, y, z),
            mark=goal.p_WT,
            reason=AIRSPACE_ENDS if beyond else ON_THE_WAY if goal.partial else "",
            viewpoint=position,
            space=state.space,
            tight=state.tight,
            progress_time=time,
            position=position,
            came=came_by(state.came, position, self._tolerance),
        )
        return self._planned(fresh, voxels, position, None, time)

    def _planned(
        self,
        state: VisibilityPlannerState,
        voxels: VoxelMap,
        position: Point,
        goal: Point | None,
        time: float,
    ) -> VisibilityPlannerState:
        n = state.status.n
        try:
            state = dc.replace(state, space=update_space(state.space, voxels))
        except ValueError as error:
            return done(state, n, "failed", str(error), None)
        places = (position, state.target, state.viewpoint, goal)
        plan, tight = make_plan(
            state.space, state.tight, places=places, parameters=self._parameters
        )
        state = dc.replace(state, tight=tight)
        return self._with_plan(state, plan, voxels, position, time)

    def _with_plan(
        self,
        state: VisibilityPlannerState,
        plan: FlightPlan,
        voxels: VoxelMap,
        position: Point,
        time: float,
    ) -> VisibilityPlannerState:
        n = state.status.n
        if plan.reason:
            return done(state, n, "failed", plan.reason, None)
        if plan.length <= self._tolerance:
            if state.path.n != n:
                state = dc.replace(state, reason=ALREADY_THERE)
            return arrived(state, position, state.heading)
        version = state.path.version + 1 if state.path.n == n else 0
        return dc.replace(
            state,
            path=Path(n, version, plan.p_WP, narrow=plan.narrow),
            map_version=voxels.version,
            plan_time=time,
            # Not the time of progress: replanning alone must not hide that it is stuck.
            least_remaining=plan.length,
            budget=max(state.budget, self._travel_factor * plan.length + BUDGET_BASE),
        )

    def _follow(
        self, state: VisibilityPlannerState, voxels: VoxelMap, position: Point, time: float
    ) -> VisibilityPlannerState:
        n, late = state.status.n, time - state.progress_time > self._stuck_time
        if not believable(position):
            return done(state, n, "failed", "the pose is lost", None) if late else state
        x, y, z = (float(value) for value in state.path.p_WP[-1])
        near = math.dist(position, (x, y, z)) <= self._tolerance
        if near and out_of_gaps(state.path, position):
            # Nobody came from anywhere by a climb at the start.
            came = _arrival(state.path) if n > 0 else None
            heading = came if state.heading is None else state.heading
            return arrived(state, position, heading)
        step = math.dist(position, state.position)
        if step >= PROGRESS:
            state = dc.replace(
                state,
                travelled=state.travelled + step,
                position=position,
                came=came_by(state.came, position, self._tolerance),
            )
        if state.travelled > state.budget:
            return done(state, n, "failed", "travel budget", None)
        remaining, _ = remaining_way(state.path.p_WP, position)
        if remaining <= state.least_remaining - PROGRESS:
            state = dc.replace(state, least_remaining=remaining, progress_time=time)
        elif late and state.recoveries < MOST_RECOVERIES:
            back = way_back(state.path, state.came, position)
            again = state.recoveries + 1
            return dc.replace(state, path=back, plan_time=time, recoveries=again)
        elif late:
            return done(state, n, "failed", "stuck", None)
        return self._replanned(state, voxels, position, (x, y, z), time)

    def _back_off(
        self, state: VisibilityPlannerState, voxels: VoxelMap, position: Point, time: float
    ) -> VisibilityPlannerState:
        """Returns the state with a new plan once the aircraft has backed off."""
        waited = time - state.plan_time >= BACK_OFF_TIME
        if not believable(position):
            lost = done(state, state.status.n, "failed", "the pose is lost", None)
            return lost if waited else state
        if not waited and math.dist(position, state.path.p_WP[-1]) > self._tolerance:
            return state
        return self._planned(dc.replace(state, progress_time=time), voxels, position, None, time)

    def _replanned(
        self,
        state: VisibilityPlannerState,
        voxels: VoxelMap,
        position: Point,
        goal: Point,
        time: float,
    ) -> VisibilityPlannerState:
        if voxels.version == state.map_version:
            return state
        due = time - state.plan_time >= self._replan_period - 1e-9
        due = due and math.dist(position, goal) > FINAL_STRETCH
        if due and not near_a_gap(state.path, position):
            return self._planned(state, voxels, position, goal, time)
        if voxels is state.space.voxels:
            return state
        try:
            space = update_space(state.space, voxels)
        except ValueError as error:
            return done(state, state.status.n, "failed", str(error), None)
        state = dc.replace(state, space=space)
        radius = self._parameters.narrow_radius
        if not way_is_blocked(space, state.path, position=position, narrow_radius=radius):
            return state
        return self._planned(state, voxels, position, goal, time)


def _arrival(path: Path) -> float | None:
    """Returns the yaw in which a path ends; None if it only rises or falls."""
    flat = path.p_WP[:, :2]
    if float(np.ptp(flat, axis=0).max()) < PROGRESS:
        return None
    return final_heading(flat)
