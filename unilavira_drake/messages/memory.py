"""What the agent remembers: the TODO list (TDM), waypoints and second chances (SCB)."""

from __future__ import annotations

from dataclasses import dataclass

from unilavira_drake.messages.frozen import Message
from unilavira_drake.messages.plans import ON_THE_WAY

CAPTION_LENGTH = 160
"""Characters of a waypoint's target and scene together."""


@dataclass(frozen=True)
class TodoItem(Message):
    """One sub-goal (paper Eq. 4): content, ``pending`` | ``completed``, and the evidence."""

    content: str = ""
    status: str = "pending"
    result: str = ""


@dataclass(frozen=True)
class TodoList(Message):
    """The list after the updates of language action ``n``, and what was wrong with them."""

    n: int = 0
    items: tuple[TodoItem, ...] = ()
    feedback: tuple[str, ...] = ()
    """One sentence for each operation that was refused or rolled back."""


@dataclass(frozen=True)
class Waypoint(Message):
    """A place where a panorama was captured."""

    id: int = 0
    n: int = 0
    """Number of the panorama first captured here."""
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """In the world, metres."""
    heading: float = 0.0
    """World yaw of this waypoint's ``front`` view, radians."""
    target_desc: str = ""
    """The vision action that led here."""
    scene: str = ""
    """The language model's sentence about the place."""
    picture: int = 0
    """Number of the key picture that shows its front view; 0 when none does."""

    @property
    def caption(self) -> tuple[str, str]:
        """Target and scene, together at most 160 characters; quoted as data in prompts."""
        scene = _clipped(self.scene, CAPTION_LENGTH)
        return _clipped(self.target_desc, CAPTION_LENGTH - len(scene)), scene


@dataclass(frozen=True)
class KeyPicture(Message):
    """A picture kept for the history, under a number that it never loses."""

    number: int = 0
    """Counts from 1 in the order of capture."""
    n: int = 0
    """The panorama whose front view it is; on the way: the language action carried out then."""
    waypoint: int = 0
    """Where it was taken; on the way: the waypoint that the robot had left."""
    direction: str = ""
    """On the way: the direction in which the waypoint was left; empty for a view at a waypoint."""
    jpeg: bytes = b""

    @property
    def name(self) -> str:
        """How prompts name it, e.g. ``H7``."""
        return f"H{self.number}"

    @property
    def label(self) -> str:
        """Name and what it is, e.g. ``H1: front view at waypoint 1``."""
        if self.direction:
            way = f"leaving waypoint {self.waypoint} by its {self.direction} view"
            return f"{self.name}: {way}"
        return f"{self.name}: front view at waypoint {self.waypoint}"


@dataclass(frozen=True)
class Edge(Message):
    """A direction tried from a waypoint and how it ended."""

    waypoint: int = 0
    direction: str = ""
    bearing: float | None = 0.0
    """World bearing of the direction, radians; None for straight down, which has none."""
    n: int = 0
    """Number of the language action that took it."""
    outcome: str = ""
    """``arrived`` (``arrived: already there`` without a drive), ``on the way``, ``failed: ...`` or
    ``returned`` (left again by a backtrack)."""
    to: int | None = None
    """The waypoint it led to; None when it led to none."""
    left: bool = False
    """Whether the robot was elsewhere when the move was over."""
    back: int | None = None
    """Number of the panorama with which it was first back at the waypoint; None while it is not."""

    @property
    def arrived(self) -> bool:
        """Whether the move ended well and was not given up since."""
        return self.outcome.startswith(("arrived", ON_THE_WAY))

    @property
    def failed(self) -> bool:
        """Whether the move failed, or was given up since."""
        return self.outcome.startswith(("failed", "returned"))


@dataclass(frozen=True)
class DecisionRecord(Message):
    """One past language action as the history tells it."""

    n: int = 0
    call: str = ""
    tool: str = ""
    argument: str = ""
    waypoint: int = 0
    """Where it was taken."""
    target_desc: str = ""
    outcome: str = ""


@dataclass(frozen=True)
class History(Message):
    """H_t of the paper: waypoints, edges, past decisions and key frames up to panorama ``n``."""

    n: int = 0
    current: int = 0
    """The waypoint at which panorama ``n`` was captured."""
    waypoints: tuple[Waypoint, ...] = ()
    edges: tuple[Edge, ...] = ()
    decisions: tuple[DecisionRecord, ...] = ()
    keyframes: tuple[KeyPicture, ...] = ()
    """Pictures at waypoints and on the way, oldest first; older ones are dropped in blocks."""

    def waypoint(self, waypoint_id: int) -> Waypoint | None:
        """Returns the waypoint with this id, or None when it is unknown or was evicted."""
        for waypoint in self.waypoints:
            if waypoint.id == waypoint_id:
                return waypoint
        return None


@dataclass(frozen=True)
class SecondChance(Message):
    """What Second Chance Backtrack adds to the prompt of call ``n``."""

    n: int = 0
    offers: tuple[int, ...] = ()
    """Waypoints to which the robot may drive back."""
    failed_edges: tuple[Edge, ...] = ()
    failed_direction: str = ""
    """On arrival after a backtrack: the direction that failed from here, else empty."""
    failed_frames: tuple[KeyPicture, ...] = ()
    """On arrival after a backtrack: pictures of the failed leg, oldest first; some of them may no
    longer be among the history's key frames."""
    revert_only: bool = False
    """Whether a backtrack is a mere revert, as before SCB: nothing that failed is told, and an
    ordinary decision follows it."""


def _clipped(text: str, limit: int) -> str:
    """Returns the text, cut after a word, with an ellipsis, to at most ``limit`` characters."""
    if len(text) <= limit:
        return text
    head = text[: max(limit - 1, 0)]
    if not head:
        return ""
    return (head.rpartition(" ")[0] or head).rstrip(" ,;") + "…"
