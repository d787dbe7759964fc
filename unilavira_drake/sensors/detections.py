"""What a perfect detector would say about a view, read from the simulator's labels."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

import numpy as np

from unilavira_drake.messages import Frame, Intrinsics
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.sensors.regions import Region, find_regions


class LabelMeaning(Protocol):
    """What a render label means."""

    @property
    def category(self) -> str:
        """Class name."""

    @property
    def instance(self) -> str:
        """Name of the thing; never part of a detection."""

    @property
    def room_kind(self) -> str:
        """Kind of room, for floors only."""


Entry = TypeVar("Entry", bound=LabelMeaning)

LEAST_PIXELS = 60
"""Connected parts with fewer pixels are not seen."""


class GroundTruthDetector:
    """Turns the label image of a frame into detections; ``perception: ground_truth``.

    One label is one detection, also when something in front cuts it into parts; walls are
    skipped.  Colour words come from the pixels.  Ranges are horizontal distances from the
    camera, which stands over the front half of the base: a frame does not know its robot.  They
    say nothing that depth does not say.

    Args:
        labels: render label -> meaning.
        max_range: metres; stands for whatever is beyond the camera's range.
    """

    def __init__(self, labels: Mapping[int, LabelMeaning], *, max_range: float = 10.0) -> None:
        self._labels = dict(labels)
        self._max_range = max_range
        self._wanted = np.zeros(32768, dtype=bool)
        for label, meaning in self._labels.items():
            self._wanted[label] = meaning.category != "wall"
        warm_up()

    def __call__(self, frame: Frame) -> ViewEvidence:
        """Returns the detections of a view; ids count in the order of the labels."""
        regions = find_regions(frame, self._wanted, LEAST_PIXELS, self._max_range)
        return ViewEvidence(
            direction=frame.view,
            width=frame.intrinsics.width,
            height=frame.intrinsics.height,
            horizontal_fov=frame.intrinsics.horizontal_fov,
            detections=tuple(
                self._detection(f"{frame.view}#{i}", region)
                for i, region in enumerate(regions, start=1)
            ),
        )

    def _detection(self, detection_id: str, region: Region) -> Detection:
        meaning = self._labels[region.label]
        return Detection(
            id=detection_id,
            category=meaning.category,
            color=region.color,
            room=meaning.room_kind if meaning.category == "floor" else "",
            box=region.box,
            point=region.point,
            pixels=region.pixels,
            distance=region.distance,
            point_distance=region.point_distance,
        )


def warm_up() -> None:
    """Compiles the kernels, so that no control loop waits for the compiler."""
    frame = Frame(
        color=np.zeros((4, 4, 3), np.uint8),
        depth=np.ones((4, 4), np.float32),
        label=np.ones((4, 4), np.int16),
        intrinsics=Intrinsics(4, 4, 4.0, 4.0, 1.5, 1.5),
    )
    find_regions(frame, np.ones(32768, dtype=bool), 1, 10.0)


def permuted_labels(labels: Mapping[int, Entry], seed: int) -> dict[int, Entry]:
    """Returns the labels with wrong meanings: what an agent would see through broken eyes.

    Class names change places among the classes of objects, room kinds among the floors, so that
    none keeps its own; walls and instance names stay.

    Args:
        labels: render label -> meaning (frozen dataclasses).
        seed: chooses the permutation.
    """
    random = np.random.default_rng(seed)
    fixed = ("floor", "wall")
    categories = sorted({entry.category for entry in labels.values()} - set(fixed))
    kinds = sorted({entry.room_kind for entry in labels.values() if entry.category == "floor"})
    category = dict(zip(categories, _derangement(categories, random), strict=True))
    kind = dict(zip(kinds, _derangement(kinds, random), strict=True))
    return {
        label: dataclasses.replace(  # type: ignore[type-var]
            entry,
            category=category.get(entry.category, entry.category),
            room_kind=kind.get(entry.room_kind, entry.room_kind),
        )
        for label, entry in labels.items()
    }


def _derangement(names: Sequence[str], random: np.random.Generator) -> list[str]:
    """Returns the names in an order that leaves none in its place (one name alone stays)."""
    if len(names) < 2:
        return list(names)
    while True:
        order = random.permutation(len(names))
        if not np.any(order == np.arange(len(names))):
            return [names[i] for i in order]
