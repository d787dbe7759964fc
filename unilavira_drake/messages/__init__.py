"""The frozen values that travel on ports."""

from unilavira_drake.messages.actions import (
    CALLS,
    TOOLS,
    LanguageAction,
    TodoUpdate,
    VisionAction,
)
from unilavira_drake.messages.frozen import Message, read_only
from unilavira_drake.messages.grounding import Candidate, Grounding
from unilavira_drake.messages.memory import (
    DecisionRecord,
    Edge,
    History,
    KeyPicture,
    SecondChance,
    TodoItem,
    TodoList,
    Waypoint,
)
from unilavira_drake.messages.observation import (
    DIRECTIONS,
    DOWN,
    SWEEP_ORDERS,
    VIEW_YAW,
    Frame,
    Intrinsics,
    Outcome,
    Panorama,
    Sweep,
    direction_of,
)
from unilavira_drake.messages.occupancy import OccupancyMap
from unilavira_drake.messages.plans import (
    ALREADY_THERE,
    NO_TARGET,
    ON_THE_WAY,
    STAIR_KINDS,
    TERMINAL_STATES,
    Awaited,
    Goal,
    NavigationStatus,
    Path,
)
from unilavira_drake.messages.voxels import VoxelMap

__all__ = [
    "ALREADY_THERE",
    "CALLS",
    "DIRECTIONS",
    "DOWN",
    "NO_TARGET",
    "ON_THE_WAY",
    "STAIR_KINDS",
    "SWEEP_ORDERS",
    "TERMINAL_STATES",
    "TOOLS",
    "VIEW_YAW",
    "Awaited",
    "Candidate",
    "DecisionRecord",
    "Edge",
    "Frame",
    "Goal",
    "Grounding",
    "History",
    "Intrinsics",
    "KeyPicture",
    "LanguageAction",
    "Message",
    "NavigationStatus",
    "OccupancyMap",
    "Outcome",
    "Panorama",
    "Path",
    "SecondChance",
    "Sweep",
    "TodoItem",
    "TodoList",
    "TodoUpdate",
    "VisionAction",
    "VoxelMap",
    "Waypoint",
    "direction_of",
    "read_only",
]
