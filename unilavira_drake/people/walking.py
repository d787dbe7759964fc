"""How a person walks: pure functions of the walk and of the robot about them."""

from __future__ import annotations

import dataclasses
import math

from unilavira_drake.messages import Message
from unilavira_drake.people.crowd import GROUND, RADIUS, Person

ACCELERATION = 1.5
"""Metres a second squared."""
TURN_GAIN, TURN_RATE = 4.0, 3.0
"""1/s of the heading's error, and at most rad/s."""
AHEAD = math.radians(60.0)
"""The robot is ahead of who walks within this angle of its direction, ..."""
ALONGSIDE = math.radians(120.0)
"""... and within this one it is beside them or ahead."""
FORESIGHT, FORESEEN = 0.25, 10
"""Polite people look so many steps of so many seconds ahead."""
OUT_OF_REACH = 2.1
"""A robot so far above or below their floor is on another storey or passes over heads, metres."""
MARGIN = 0.25
"""What they want to keep between them and the robot, metres."""
TURNING, TURNING_SOON = 0.10, 4
"""Metres to keep from what a robot sweeps when it turns, as far as so many steps go."""
ELBOW, SOON = 0.15, 4
"""Who would have the robot nearer than this, metres, within so many steps gives way to it."""
SIDESTEP = 0.5
"""Share of their speed at which they do so sideways and backwards; ahead they do at all of it."""
STANDING = 0.05
"""A slower robot stands, metres a second."""
BACK = math.radians(120.0)
"""Who is to go on at more than this angle to how they move comes to a stand first."""
REACHED = 0.10
"""A point of the walk is reached within this distance, metres."""
SLOWEST = 0.25
"""Who moves with less than this share of the wish does not get on."""
STEP = 0.70
"""Length of a step, metres."""
SWING = 0.42
"""Of a leg at a metre a second and more, radians; an arm swings half as far."""


@dataclasses.dataclass(frozen=True)
class Walker(Message):
    """Where in the walk a person is, and the gait."""

    target: int = 1
    """Index of the point that is walked to."""
    way: int = 1
    """1: to the last point; -1: back to the first."""
    rested: int = 0
    """How many rests have begun."""
    resume: float = 0.0
    """The rest ends at this time, seconds."""
    held: float = -1.0
    """Since when it does not go on; -1 while it does, seconds."""
    speed: float = 0.0
    """Wished just now, metres a second, ..."""
    course: float = 0.0
    """... and in which direction, radians in the world."""
    phase: float = 0.0
    """Of the gait, radians; pi is a step."""


@dataclasses.dataclass(frozen=True)
class Wish(Message):
    """The velocity that a person wants: metres and radians a second, in the world."""

    vx: float = 0.0
    vy: float = 0.0
    yaw_rate: float = 0.0


@dataclasses.dataclass(frozen=True)
class RobotSeen(Message):
    """A robot as people see it: a rectangle that moves straight on."""

    x: float = 0.0
    y: float = 0.0
    """Of its middle, metres."""
    yaw: float = 0.0
    half_length: float = 0.0
    half_width: float = 0.0
    vx: float = 0.0
    vy: float = 0.0
    """Metres a second, in the world."""
    z: float = 0.0
    """Of its base, metres in the world."""

    @property
    def within_reach(self) -> bool:
        """Whether people can meet it: an upper storey's robots and high flights they cannot."""
        return abs(self.z - GROUND) < OUT_OF_REACH

    def nearest(self, x: float, y: float, after: float = 0.0) -> tuple[float, float]:
        """Returns its point nearest to (x, y), relative to that, in so many seconds; metres."""
        dx, dy = x - self.x - self.vx * after, y - self.y - self.vy * after
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        u = min(max(c * dx + s * dy, -self.half_length), self.half_length)
        v = min(max(c * dy - s * dx, -self.half_width), self.half_width)
        return c * u - s * v - dx, s * u + c * v - dy

    def reach(self, x: float, y: float, after: float = 0.0) -> float:
        """Returns metres from (x, y) to the disc that it sweeps when it turns in place."""
        dx, dy = x - self.x - self.vx * after, y - self.y - self.vy * after
        return math.hypot(dx, dy) - math.hypot(self.half_length, self.half_width)


@dataclasses.dataclass(frozen=True)
class Manners(Message):
    """How people treat a robot in their way, see ``PeopleConfig``."""

    polite: bool = True
    stop_distance: float = 1.0
    patience: float = 4.0


def next_step(
    person: Person,
    walker: Walker,
    manners: Manners,
    *,
    time: float,
    period: float,
    pose: tuple[float, float, float],
    moving: float,
    robot: RobotSeen | None,
) -> tuple[Walker, Wish]:
    """Returns where in the walk the person is now, and the wish for the next period.

    Args:
        person: with the walk.
        walker: a period ago.
        manners: polite people stop for the robot; who waits too long turns back.
        time: seconds.
        period: seconds.
        pose: x, y (metres) and yaw (radians) of the person.
        moving: measured speed, metres a second.
        robot: None without one.
    """
    x, y, yaw = pose
    walker = _arrived(person, walker, time, x, y)
    target = _way_out(person, walker, robot, pose) if manners.polite and robot else None
    if target is not None and target != walker.target:
        walker = dataclasses.replace(walker, target=target, way=-walker.way)
    goal_x, goal_y = person.walk[walker.target]
    bearing = math.atan2(goal_y - y, goal_x - x)
    resting = target is None and time < max(walker.resume, person.delay)
    waits = (
        not resting
        and target is None
        and manners.polite
        and robot is not None
        and _must_wait(robot, x, y, bearing, person.speed, manners)
    )
    error = math.remainder(bearing - yaw, 2.0 * math.pi)
    turns_back = _turns_back(walker, bearing)
    least = 0.0 if target is None else SIDESTEP
    wish = person.speed * max(math.cos(error), least)
    if resting or waits or turns_back:
        wish = 0.0
    step = ACCELERATION * period
    speed = min(max(wish, walker.speed - 2.0 * step), walker.speed + step)
    walker = _patient(
        person,
        walker,
        manners,
        time,
        blocked=not resting and (waits or (walker.speed > 0.3 and moving < SLOWEST * walker.speed)),
    )
    walker = dataclasses.replace(
        walker,
        speed=speed,
        course=walker.course if turns_back else bearing,
        phase=math.remainder(walker.phase + math.pi * speed * period / STEP, 2.0 * math.pi),
    )
    turn = (
        0.0
        if target is not None or (resting and walker.speed < 0.05)
        else min(max(TURN_GAIN * error, -TURN_RATE), TURN_RATE)
    )
    course = walker.course
    return walker, Wish(speed * math.cos(course), speed * math.sin(course), turn)


def swing(walker: Walker) -> float:
    """Returns the angle of the left leg, radians; the right one's is its negative."""
    return SWING * min(walker.speed, 1.0) * math.sin(walker.phase)


def _arrived(person: Person, walker: Walker, time: float, x: float, y: float) -> Walker:
    goal_x, goal_y = person.walk[walker.target]
    if math.hypot(goal_x - x, goal_y - y) > REACHED:
        return walker
    last = walker.target in (0, len(person.walk) - 1)
    way = (1 if walker.target == 0 else -1) if last else walker.way
    walker = dataclasses.replace(walker, target=walker.target + way, way=way)
    if not last:
        return walker
    pause = person.pauses[walker.rested % len(person.pauses)]
    return dataclasses.replace(walker, rested=walker.rested + 1, resume=time + pause)


def _patient(
    person: Person, walker: Walker, manners: Manners, time: float, *, blocked: bool
) -> Walker:
    """Turns back who could not go on for too long."""
    if not blocked:
        return walker if walker.held < 0.0 else dataclasses.replace(walker, held=-1.0)
    if walker.held < 0.0:
        return dataclasses.replace(walker, held=time)
    if time - walker.held < manners.patience:
        return walker
    target = min(max(walker.target - walker.way, 0), len(person.walk) - 1)
    return dataclasses.replace(walker, target=target, way=-walker.way, held=-1.0)


def _turns_back(walker: Walker, bearing: float) -> bool:
    """Whether the person must come to a stand before it can go in this direction."""
    turn = abs(math.remainder(bearing - walker.course, 2.0 * math.pi))
    return walker.speed > 0.0 and turn > BACK


def _covered(speed: float, pace: float, after: float) -> float:
    """Returns how far towards a point somebody gets in so many seconds, metres.

    Args:
        speed: towards it now, metres a second; below 0 away from it.
        pace: at which they will go there, metres a second.
        after: seconds.
    """
    if speed < 0.0:
        braking = min(after, -speed / (2.0 * ACCELERATION))
        back = (speed + ACCELERATION * braking) * braking
        return back + _covered(0.0, pace, after - braking)
    rate = ACCELERATION if speed < pace else -2.0 * ACCELERATION
    changing = min(after, (pace - speed) / rate)
    return (speed + rate * changing / 2.0) * changing + pace * (after - changing)


def _way_out(
    person: Person, walker: Walker, robot: RobotSeen, pose: tuple[float, float, float]
) -> int | None:
    """Returns the point of the walk to which the person gives way; None if there is no need to.

    They leave their walk for nobody: they go on or back, whatever takes them farther from where
    the robot comes too near, and stay if neither does.
    """
    if not robot.within_reach or math.hypot(robot.vx, robot.vy) < STANDING:
        return None
    x, y, yaw = pose
    steps = [k * FORESIGHT for k in range(1, SOON + 1)]
    near = math.hypot(*robot.nearest(x, y))
    staying = min(math.hypot(*robot.nearest(x, y, after)) for after in steps)
    if staying > RADIUS + ELBOW or staying >= near:
        return None
    best, found = staying, None
    for target in (walker.target, walker.target - walker.way):
        if not 0 <= target < len(person.walk):
            continue
        dx, dy = person.walk[target][0] - x, person.walk[target][1] - y
        left = math.hypot(dx, dy)
        if left <= REACHED:
            continue
        bearing = math.atan2(dy, dx)
        pace = person.speed * max(math.cos(bearing - yaw), SIDESTEP)
        speed = -walker.speed if _turns_back(walker, bearing) else walker.speed
        moved = [min(_covered(speed, pace, after), left) / left for after in steps]
        going = min(
            math.hypot(*robot.nearest(x + dx * part, y + dy * part, after))
            for part, after in zip(moved, steps, strict=True)
        )
        if going > best:
            best, found = going, target
    return found


def _must_wait(
    robot: RobotSeen, x: float, y: float, bearing: float, speed: float, manners: Manners
) -> bool:
    """Whether the robot is near ahead, or would come too near if both went straight on."""
    if not robot.within_reach:
        return False
    dx, dy = robot.nearest(x, y)
    near = math.hypot(dx, dy)
    turn = abs(math.remainder(math.atan2(dy, dx) - bearing, 2.0 * math.pi))
    if near < manners.stop_distance and turn < AHEAD:
        return True
    vx, vy = speed * math.cos(bearing), speed * math.sin(bearing)
    # A robot that stands may turn at any moment.
    now = robot.reach(x, y)
    for k in range(1, TURNING_SOON + 1):
        after = k * FORESIGHT
        if robot.reach(x + vx * after, y + vy * after, after) < min(RADIUS + TURNING, now):
            return True
    if math.hypot(robot.vx, robot.vy) < STANDING:
        return False
    # It may not see who walks along beside it, and turn.
    if near < RADIUS + MARGIN and turn < ALONGSIDE:
        return True
    for k in range(1, FORESEEN + 1):
        after = k * FORESIGHT
        distance = math.hypot(*robot.nearest(x + vx * after, y + vy * after, after))
        # Who is too near already may go where it becomes more.
        if distance < min(RADIUS + MARGIN, near):
            return True
    return False
