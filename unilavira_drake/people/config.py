"""The people of a scenario."""

import dataclasses as dc


@dc.dataclass
class WalkRoute:
    """A walk of one person: to the last waypoint and back again, without end."""

    # ROOM or X,Y (metres) each, at least two; the shortest way over free floor joins them.
    waypoints: list[str] = dc.field(default_factory=list)
    # Metres a second; null: drawn.
    speed: float | None = None
    # Seconds of rest at each end; null: drawn each time.
    pause: float | None = None
    # Seconds before the first step.
    delay: float = 0.0
    # Colour word of the clothes; empty: drawn.
    color: str = ""


@dc.dataclass
class PeopleConfig:
    """How many people walk about in the world, where, and how they behave.

    What is drawn follows ``seed``; the simulation itself is the same every time.
    """

    # 0: nobody, and nothing of this is built.
    count: int = 0
    # null: the scenario's random_seed.
    seed: int | None = None
    # The first people walk these; the others walk between rooms that are drawn.
    routes: list[WalkRoute] = dc.field(default_factory=list)
    # Of walks that are drawn: metres a second, seconds of rest.
    min_speed: float = 0.6
    max_speed: float = 1.2
    min_pause: float = 1.0
    max_pause: float = 6.0
    # true: they stop when the robot is nearer than stop_distance (metres) ahead of them, and give
    # way along their walk when it would touch them.
    # false: they keep walking, and push what they meet.
    polite: bool = True
    stop_distance: float = 1.0
    # Who could not go on for so long turns back, seconds.
    patience: float = 4.0
    # Whether the mapper knows which pixels are people, as a detector would tell it: from the
    # simulator's labels, so the result then says perception ground_truth.  false: depth alone.
    detected: bool = True
    # Whether the prompt says who is where and moves how: the simulator's labels tell it, so the
    # result then says perception ground_truth.
    in_prompt: bool = False


def tells_of_people(config: PeopleConfig) -> bool:
    """Whether prompts say who is where and moves how."""
    return config.count > 0 and config.in_prompt


def reads_labels(config: PeopleConfig) -> bool:
    """Whether anything of the robot is told by labels who is a person."""
    return config.count > 0 and (config.in_prompt or config.detected)
