"""A scenario: one tree of dataclasses that says everything about an episode.

Read by Drake's ``yaml_load_typed``: a tag (``!CobotMagic``) chooses among types, an unknown key
is an error, and overlays change single values.  Every flag of the command is such an overlay.
"""

import copy
import dataclasses as dc
import functools
import operator
import typing

from pydrake.multibody.plant import MultibodyPlantConfig

from unilavira_drake.mapping.config import MappingConfig
from unilavira_drake.memory.config import MemoryConfig
from unilavira_drake.mllm.latency import (
    ConstantLatency,
    LognormalLatency,
    MeasuredLatency,
    NoLatency,
    PaperLatency,
    RealTimeLatency,
    RecordedLatency,
)
from unilavira_drake.people.config import PeopleConfig
from unilavira_drake.planning.config import PlanningConfig
from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.robots.flight_config import FlightConfig
from unilavira_drake.robots.localization_config import PoseEstimateConfig
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.robot import Robot
from unilavira_drake.robots.robot_class import check_robot_class, same_class
from unilavira_drake.robots.unitree_g1 import UnitreeG1
from unilavira_drake.robots.unitree_go1 import UnitreeGo1
from unilavira_drake.sensors.exposure_config import ExposureConfig

# What may be unwired: nothing, TODO List Memory, Second Chance Backtrack, or both; or both with the
# predecessor's one-step revert in their place.
ABLATIONS = ("full", "no_tdm", "no_scb", "no_both", "lavira")
RENDERERS = ("vtk", "raster")
GROUNDERS = ("none", "color", "label")

# The first one is meant where a file writes no tag.
RobotChoice = CobotMagic | UnitreeGo1 | UnitreeG1 | Quadrotor

# Likewise.
LatencyChoice = (
    NoLatency
    | ConstantLatency
    | LognormalLatency
    | PaperLatency
    | RecordedLatency
    | MeasuredLatency
    | RealTimeLatency
)


@dc.dataclass
class WorldChoice:
    """Which world, and whether it is mirrored."""

    name: str = "apartment"
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
    # EQA: the closed vocabulary of the answer; empty: any words.
    choices: list[str] = dc.field(default_factory=list)
    # EQA: what kind of question it is, e.g. color, location, count; only for statistics.
    question_type: str = ""
    # How a stop is judged: home | habitat | ovon | uni_lavira.
    protocol: str = "home"


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

    # null: as many as the task's family has, 40 on the ground.
    decisions: int | None = None
    # Simulated seconds; null: those of the task's family, 1800 on the ground.
    simulated_time: float | None = None
    # Simulated seconds without any progress of the ring.
    stall: float = 600.0
    # Of both models together, null: no limit. Calls, tokens in and out, seconds that the models
    # took (wall-clock, or as recorded), US dollars.
    model_calls: int | None = None
    model_tokens: int | None = None
    model_seconds: float | None = None
    model_cost_usd: float | None = None


@dc.dataclass
class Scenario:
    """A complete, serialisable experiment."""

    # The file's stem, filled in when it is read.
    name: str = ""
    description: str = ""
    random_seed: int = 0
    world: WorldChoice = dc.field(default_factory=WorldChoice)
    robot: RobotChoice = dc.field(default_factory=CobotMagic)
    pose_estimate: PoseEstimateConfig = dc.field(default_factory=PoseEstimateConfig)
    # Seconds between two recalibrations: they end the drift of the pose, lock the exposure anew;
    # 0: there are none.
    recalibration_period: float = 0.0
    exposure: ExposureConfig = dc.field(default_factory=ExposureConfig)
    # Where the robot starts unless the task says otherwise: ROOM or X,Y,YAW.
    start: str = ""
    # Who walks about in the world.
    people: PeopleConfig = dc.field(default_factory=PeopleConfig)
    tasks: dict[str, NamedTask] = dc.field(default_factory=dict)
    default_task: str = ""
    task: TaskChoice = dc.field(default_factory=TaskChoice)
    # SPEC of the models: rules[:PRESET] | random | frontier | cassette:FILE | mailbox:DIR |
    # PROFILE | PROFILE.yaml | openai:MODEL@BASE_URL.
    language_model: str = "rules"
    vision_model: str = "rules"
    # SPEC of the model that gives an answer to a question a mark of 1 to 5; empty: none does.
    judge_model: str = ""
    # A cassette that keeps every reply of this episode; empty: none.
    record: str = ""
    # record: a new file. record_new: replies that the file holds are replayed, others are asked
    # for and added.
    record_mode: str = "record"
    # compact: history in small pictures. paper: every picture in full.
    prompt_preset: str = "compact"
    # Simulated seconds from a request to its reply.
    language_latency: LatencyChoice = dc.field(default_factory=NoLatency)
    vision_latency: LatencyChoice = dc.field(default_factory=NoLatency)
    # full | no_tdm | no_scb | no_both | lavira.
    ablation: str = "full"
    # What mends a mark of the vision model that is doubted. none | color (pixels) | label (the
    # simulator's labels: the result then says perception ground_truth).
    grounder: str = "none"
    # vtk | raster.
    renderer: str = "raster"
    meshcat: bool = False
    # Period of every level of the ring, seconds.
    tick: float = 0.1
    budgets: Budgets = dc.field(default_factory=Budgets)
    mapping: MappingConfig = dc.field(default_factory=MappingConfig)
    planning: PlanningConfig = dc.field(default_factory=PlanningConfig)
    # Of aircraft, in place of mapping and planning.
    flight: FlightConfig = dc.field(default_factory=FlightConfig)
    memory: MemoryConfig = dc.field(default_factory=MemoryConfig)
    # A robot may need shorter steps.
    plant: MultibodyPlantConfig = dc.field(
        default_factory=lambda: MultibodyPlantConfig(
            time_step=0.025, discrete_contact_approximation="sap"
        )
    )


def plant_config(scenario: Scenario) -> MultibodyPlantConfig:
    """Returns the plant's configuration, its steps no longer than the robot's autopilot needs."""
    config = copy.copy(scenario.plant)
    if isinstance(scenario.robot, Quadrotor):
        config.time_step = min(config.time_step, scenario.robot.max_time_step)
    return config


def register_robot(kind: type[Robot]) -> None:
    """Makes a robot of one's own a choice in scenarios; its tag is the name of the class.

    A class that is registered again, as it is or after a reload of its module, takes its own place.

    Args:
        kind: a dataclass whose fields all have defaults; tag and ``name`` are no other robot's.

    Raises:
        ScenarioError: names place, value and remedy where scenarios could not use it.
    """
    field = Scenario.__dataclass_fields__["robot"]
    kinds = typing.get_args(field.type)
    check_robot_class(kind, kinds)
    kept = [kind if same_class(other, kind) else other for other in kinds]
    choice = functools.reduce(operator.or_, kept if kind in kept else [*kept, kind])
    field.type = typing.cast(type, choice)


def robot_kinds() -> dict[str, type[Robot]]:
    """Returns the robots that a scenario may choose, by name."""
    kinds = typing.get_args(Scenario.__dataclass_fields__["robot"].type)
    return {kind().name: kind for kind in kinds}
