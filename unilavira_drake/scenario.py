"""A scenario: one tree of dataclasses that says everything about an episode.

Read by Drake's ``yaml_load_typed``: a tag (``!CobotMagic``) chooses among types, an unknown key
is an error, and overlays change single values.  Every flag of the command is such an overlay.
"""

import dataclasses as dc

from pydrake.multibody.plant import MultibodyPlantConfig

from unilavira_drake.mllm.latency import ConstantLatency, LognormalLatency, NoLatency
from unilavira_drake.robots.cobot_magic import CobotMagic

SCHEMA_VERSION = 1

# What may be unwired: nothing, TODO List Memory, Second Chance Backtrack, or both.
ABLATIONS = ("full", "no_tdm", "no_scb", "no_both")
RENDERERS = ("vtk",)


@dc.dataclass
class WorldChoice:
    """Which world, and whether it is mirrored."""

    name: str = "flat"
    # Mirrors the world and every start in the x axis (y -> -y).
    mirror: bool = False


@dc.dataclass
class NamedTask:
    """A task with the goal that scores it; the goal never reaches the agent."""

    family: str = "vln"
    text: str = ""
    # ROOM or X,Y,YAW (metres, radians).
    start: str = ""
    # INSTANCE, ROOM or X,Y[,Z]; alternatives are joined by '|'.
    goal: str = ""
    # EQA: the expected answer and other accepted ones.
    answer: str = ""
    accept: list[str] = dc.field(default_factory=list)


@dc.dataclass
class TaskChoice:
    """The task of this episode; the scenario's default task when all fields are empty."""

    # Free text, or @NAME of a named task.
    text: str = ""
    # Scores free text against INSTANCE, ROOM or X,Y[,Z].
    goal: str = ""
    # Overrides the start: ROOM or X,Y,YAW.
    start: str = ""


@dc.dataclass
class Budgets:
    """What ends an episode with a named cause."""

    decisions: int = 40
    # Simulated seconds.
    simulated_time: float = 1800.0
    # Simulated seconds without any progress of the ring.
    stall: float = 600.0


@dc.dataclass
class MappingConfig:
    """The occupancy map and when it is updated."""

    # Side of a cell, metres.
    resolution: float = 0.05
    # Depth is integrated up to this range, metres.
    max_range: float = 5.0
    # Heights above the floor that count as obstacles, metres.
    min_height: float = 0.10
    max_height: float = 1.40
    # Every so many rows and columns of a depth image; 3 pixels at 5 m are less than a cell.
    stride: int = 3
    # Update after this much travel (metres) or turning (degrees); at rest this often (seconds).
    travel: float = 0.2
    turn_degrees: float = 20.0
    rest_period: float = 2.0


@dc.dataclass
class PlanningConfig:
    """Goal snapping, progress watch and travel budget."""

    # A goal moves at most this far to reachable free space, metres.
    snap_distance: float = 1.5
    # Arrived within this distance of the goal, metres.
    tolerance: float = 0.10
    # Stuck after this long without progress, seconds.
    stuck_time: float = 6.0
    # Gives up after travelling this many times the planned length, plus 3 m.
    travel_factor: float = 3.0


@dc.dataclass
class MemoryConfig:
    """Bounds of what the agent remembers."""

    waypoints: int = 32
    # Decisions told in the history.
    decisions: int = 8
    # Egocentric key frames of one leg, and the travel between two of them, metres.
    keyframes: int = 6
    keyframe_travel: float = 1.5
    # A place closer than this to a waypoint is that waypoint, metres.
    merge_distance: float = 0.5


@dc.dataclass
class Scenario:
    """A complete, serialisable experiment."""

    # The file's stem, filled in when it is read.
    name: str = ""
    description: str = ""
    random_seed: int = 0
    world: WorldChoice = dc.field(default_factory=WorldChoice)
    robot: CobotMagic = dc.field(default_factory=CobotMagic)
    # Where the robot starts unless the task says otherwise: ROOM or X,Y,YAW.
    start: str = ""
    tasks: dict[str, NamedTask] = dc.field(default_factory=dict)
    default_task: str = ""
    task: TaskChoice = dc.field(default_factory=TaskChoice)
    # SPEC of the models: rules[:PRESET] | random | frontier.
    language_model: str = "rules"
    vision_model: str = "rules"
    language_latency: NoLatency | ConstantLatency | LognormalLatency = dc.field(
        default_factory=NoLatency
    )
    vision_latency: NoLatency | ConstantLatency | LognormalLatency = dc.field(
        default_factory=NoLatency
    )
    # full | no_tdm | no_scb | no_both.
    ablation: str = "full"
    renderer: str = "vtk"
    meshcat: bool = False
    # Period of every level of the ring, seconds.
    tick: float = 0.1
    budgets: Budgets = dc.field(default_factory=Budgets)
    mapping: MappingConfig = dc.field(default_factory=MappingConfig)
    planning: PlanningConfig = dc.field(default_factory=PlanningConfig)
    memory: MemoryConfig = dc.field(default_factory=MemoryConfig)
    plant: MultibodyPlantConfig = dc.field(
        default_factory=lambda: MultibodyPlantConfig(
            time_step=0.025, discrete_contact_approximation="lagged"
        )
    )
