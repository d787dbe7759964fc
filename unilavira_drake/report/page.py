"""``report.html``: the records of a run as one page that needs nothing else."""

from __future__ import annotations

import base64
import dataclasses
import functools
import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path

import jinja2
from markupsafe import Markup

from unilavira_drake.messages import Frame
from unilavira_drake.messages.metrics import CAUSES
from unilavira_drake.report.doubt import GroundingPanel, grounding_panel
from unilavira_drake.report.figures import run_figures
from unilavira_drake.report.model import RunRecord, Step, read_run
from unilavira_drake.report.pictures import Picture, Pictures
from unilavira_drake.report.setting import read_setting
from unilavira_drake.report.sheet import Overlay, Sheet
from unilavira_drake.report.words import (
    LEAST_TRAVEL,
    action_words,
    outcome_words,
    reasoning,
    step_badges,
    travel_words,
)

VIEW_ORDER = ("left", "front", "right", "back", "down")
"""As one would turn the head: neighbours stand side by side."""


@dataclass(frozen=True)
class ViewPanel:
    """One view of a panorama on the page."""

    direction: str
    picture: Picture | None
    width: int
    height: int
    chosen: bool


@dataclass(frozen=True)
class StepPanel:
    """One step with everything drawn and worded."""

    step: Step
    title: str
    badges: tuple[tuple[str, str], ...]
    reasoning: tuple[tuple[str, str, str], ...]
    outcome: str
    failed: bool
    views: tuple[ViewPanel, ...]
    chosen: ViewPanel | None
    pointed: bool
    """Whether there is a vision action to be shown on the chosen view."""
    grounding: GroundingPanel | None
    first: int | None
    """The step under which the same panorama was first seen, if that was another one."""
    overlay: Overlay
    travel: str
    """How long this step's action took and how far it led, in words; empty if nowhere."""
    drove: bool
    """Whether the action moved the robot."""
    aim_distance: float | None
    """Metres from the robot to the aim: straight in flight, else on the floor."""
    parsed: str


def render_report(folder: Path) -> str:
    """Returns the page of a run folder, complete or not.

    Raises:
        InputError: if it is no run folder, or nothing in its transcript can be read.
    """
    run = read_run(folder)
    setting = read_setting(folder, run.result)
    pictures = Pictures(folder)
    sheet = Sheet(run, setting)
    panels = tuple(_panel(step, run, pictures, sheet) for step in run.steps)
    style, script = _asset("style.css"), _asset("script.js")
    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            run=run,
            result=run.result,
            setting=setting,
            task=run.task or setting.task,
            goal=setting.goal or (run.result.task.goal if run.result is not None else ""),
            cause=CAUSES.get(run.result.cause, "") if run.result is not None else "",
            figures=run_figures(run),
            panels=panels,
            sheet=sheet,
            frames=pictures.frames,
            problems=(*run.problems, *setting.problems, *pictures.problems),
            # Nothing in these two comes from a run.
            style=Markup(style),
            script=Markup(script),
            policy=_policy(style, script),
        )
    )


def _panel(step: Step, run: RunRecord, pictures: Pictures, sheet: Sheet) -> StepPanel:
    views = _views(step, pictures)
    chosen = next((view for view in views if view.chosen), None)
    uri = pictures.map(step.map.image) if step.map is not None else ""
    first = step.panorama.first if step.panorama is not None else step.n
    return StepPanel(
        step=step,
        title=action_words(step),
        badges=step_badges(step),
        reasoning=reasoning(step),
        outcome=outcome_words(step),
        failed=step.status is not None and step.status.state == "failed",
        views=views,
        chosen=chosen,
        pointed=chosen is not None and step.vision is not None,
        grounding=grounding_panel(step.grounding),
        first=None if first == step.n else first,
        overlay=sheet.overlay(step, uri),
        travel=_travel(step, run),
        drove=_drove(step, run),
        aim_distance=_aim_distance(step),
        parsed=_parsed(step),
    )


def _views(step: Step, pictures: Pictures) -> tuple[ViewPanel, ...]:
    if step.panorama is None:
        return ()
    turns = step.action is not None and step.action.tool == "turn"
    direction = step.action.direction if step.action is not None and turns else ""

    def place(frame: Frame) -> int:
        return VIEW_ORDER.index(frame.view) if frame.view in VIEW_ORDER else len(VIEW_ORDER)

    return tuple(
        ViewPanel(
            direction=frame.view,
            picture=pictures.frame(frame.jpeg.decode("ascii")),
            width=frame.intrinsics.width,
            height=frame.intrinsics.height,
            chosen=frame.view == direction,
        )
        for frame in sorted(step.panorama.frames, key=place)
    )


def _drove(step: Step, run: RunRecord) -> bool:
    if step.decided is None or step.ended is None:
        return False
    return run.trace.travel(step.decided, step.ended) >= LEAST_TRAVEL


def _travel(step: Step, run: RunRecord) -> str:
    if step.decided is None or step.ended is None:
        return ""
    begin, end = run.span(step)
    words = travel_words(
        step.ended - step.decided,
        run.trace.travel(begin, end),
        run.trace.travel(step.ended, end),
        run.trace.climb(step.n),
    )
    # An aircraft takes off before it is asked anything.
    before = run.trace.travel(-math.inf, begin) if step is run.steps[0] else 0.0
    if before < LEAST_TRAVEL:
        return words
    return f"Before that it went {before:.1f} m. {words}".strip()


def _aim_distance(step: Step) -> float | None:
    if step.goal is None or step.goal.p_WG is None or step.panorama is None:
        return None
    axes = 3 if step.panorama.in_flight else 2
    return math.dist(step.goal.p_WG[:axes], step.panorama.position[:axes])


def _parsed(step: Step) -> str:
    """The actions of a step as JSON, without fields that say nothing."""
    said = {
        "language_action": step.action,
        "vision_action": step.vision,
        "grounding": step.grounding,
    }
    parts = {
        name: {
            key: value
            for key, value in dataclasses.asdict(message).items()
            # What a grounding holds of the vision action stands above it.
            if value not in (None, "", (), False) and key != "action"
        }
        for name, message in said.items()
        if message is not None
    }
    return json.dumps(parts, indent=2, ensure_ascii=False) if parts else ""


def _policy(style: str, script: str) -> str:
    """The page may use its own style, script and pictures, and nothing else."""
    return (
        f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; "
        f"script-src '{_hash(script)}'; base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"


def _asset(name: str) -> str:
    environment = _environment()
    assert environment.loader is not None
    return environment.loader.get_source(environment, name)[0]


@functools.lru_cache(maxsize=1)
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("unilavira_drake.report"),
        undefined=jinja2.StrictUndefined,
        # All of it: replies, scenes, names of things, paths.
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        auto_reload=False,
    )
