import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from unilavira_drake.messages import Frame
from unilavira_drake.sensors.color_names import COLOR_WORDS
from unilavira_drake.sensors.detections import GroundTruthDetector, permuted_labels
from unilavira_drake.sensors.rig import pinhole
from unilavira_drake.worlds.load import load_world
from unilavira_drake.worlds.palette import PALETTE
from unilavira_drake.worlds.world import LabelEntry

LABELS = {
    1: LabelEntry("sofa", "sofa_1"),
    2: LabelEntry("plant", "plant_1"),
    3: LabelEntry("floor", "kitchen_floor", "kitchen"),
    4: LabelEntry("wall", "walls"),
}
WIDTH, HEIGHT = 160, 120


def level_pose():
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    X_WC[:3, 3] = (1.0, 2.0, 1.0)
    return X_WC


def frame_of(label, *, depth=None, color=None):
    return Frame(
        view="left",
        label=label.astype(np.int16),
        depth=np.full(label.shape, 2.0, np.float32) if depth is None else depth,
        color=np.zeros((*label.shape, 3), np.uint8) if color is None else color,
        intrinsics=pinhole(label.shape[1], label.shape[0], 79.0),
        X_WC=level_pose(),
    )


def canvas():
    return np.full((HEIGHT, WIDTH), 32766)


def test_a_rectangle_is_one_detection_with_its_box_colour_and_range():
    label, color = canvas(), np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    label[30:70, 20:60] = 1
    color[30:70, 20:60] = (200, 20, 20)
    evidence = GroundTruthDetector(LABELS)(frame_of(label, color=color))
    assert (evidence.direction, evidence.width, evidence.height) == ("left", WIDTH, HEIGHT)
    assert evidence.horizontal_fov == pytest.approx(math.radians(79))
    (found,) = evidence.detections
    assert (found.id, found.category, found.color, found.room) == ("left#1", "sofa", "red", "")
    assert found.box == (20, 30, 60, 70)
    assert found.pixels == 1600
    assert found.point == pytest.approx((39.5, 49.5), abs=1.5)
    # Depth 2 along the axis; horizontally farther off to the left.
    k = pinhole(WIDTH, HEIGHT, 79.0)
    assert found.point_distance == pytest.approx(
        2 * math.hypot(1, (found.point[0] - k.cx) / k.fx), rel=1e-5
    )
    columns = np.hypot(1, (np.arange(20, 60) - k.cx) / k.fx) * 2
    assert found.distance == pytest.approx(np.median(columns), rel=1e-5)


def test_specks_and_walls_are_skipped_and_parts_joined():
    label = canvas()
    label[10:40, 10:30] = 1
    label[10:40, 40:60] = 1
    label[100:107, 100:108] = 1
    label[50:57, 10:18] = 2
    label[60:80, :] = 4
    (found,) = GroundTruthDetector(LABELS)(frame_of(label)).detections
    assert found.box == (10, 10, 60, 40)
    assert found.pixels == 1200
    assert 10 <= found.point[0] < 30 or 40 <= found.point[0] < 60


def test_floors_tell_their_room_and_ids_follow_the_labels():
    label = canvas()
    label[0:20, 0:20] = 3
    label[30:50, 0:20] = 2
    label[60:90, 0:20] = 1
    found = GroundTruthDetector(LABELS)(frame_of(label)).detections
    assert [(d.id, d.category, d.room) for d in found] == [
        ("left#1", "sofa", ""),
        ("left#2", "plant", ""),
        ("left#3", "floor", "kitchen"),
    ]


def test_what_is_too_far_for_the_camera_counts_as_its_range():
    label = canvas()
    label[30:70, 20:60] = 1
    depth = np.full((HEIGHT, WIDTH), np.inf, np.float32)
    (found,) = GroundTruthDetector(LABELS, max_range=7.0)(frame_of(label, depth=depth)).detections
    assert found.distance == found.point_distance == 7.0


def test_nothing_in_view_is_no_detection():
    assert GroundTruthDetector(LABELS)(frame_of(canvas())).detections == ()


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.integers(0, 10_000))
def test_regions_equal_those_of_scipy(seed):
    random = np.random.default_rng(seed)
    coarse = random.choice([1, 2, 3, 4, 32766], (12, 16))
    label = np.kron(coarse, np.ones((7, 7), int))
    label = np.where(random.uniform(size=label.shape) < 0.02, 2, label)
    depth = random.uniform(1, 5, label.shape).astype(np.float32)
    found = {
        d.category: d for d in GroundTruthDetector(LABELS)(frame_of(label, depth=depth)).detections
    }
    for value in (1, 2, 3):
        parts, count = ndimage.label(label == value)
        sizes = ndimage.sum_labels(np.ones_like(parts), parts, np.arange(1, count + 1))
        mask = np.isin(parts, 1 + np.flatnonzero(sizes >= 60))
        category = LABELS[value].category
        assert (category in found) == bool(mask.any())
        if not mask.any():
            continue
        detection = found[category]
        rows, columns = np.nonzero(mask)
        assert detection.pixels == mask.sum()
        assert detection.box == (
            columns.min(),
            rows.min(),
            columns.max() + 1,
            rows.max() + 1,
        )
        u, v = (int(value) for value in detection.point)
        assert mask[v, u]
        k = pinhole(label.shape[1], label.shape[0], 79.0)
        ranges = depth * np.hypot(1, (np.arange(label.shape[1]) - k.cx) / k.fx)
        if mask.sum() <= 4000:
            assert detection.distance == pytest.approx(np.median(ranges[mask]), rel=1e-4)
        assert detection.point_distance == pytest.approx(ranges[v, u], rel=1e-5)


def test_the_point_is_as_deep_inside_as_any():
    label = canvas()
    label[20:60, 20:60] = 1
    label[35:45, 60:150] = 1
    (found,) = GroundTruthDetector(LABELS)(frame_of(label)).detections
    inside = ndimage.distance_transform_edt(label == 1)
    u, v = (int(value) for value in found.point)
    assert inside[v, u] >= inside.max() - 1.5


def test_a_mirrored_image_gives_mirrored_detections():
    label = canvas()
    label[20:60, 20:60] = 1
    label[70:110, 31:152] = 3
    plain = GroundTruthDetector(LABELS)(frame_of(label)).detections
    image = GroundTruthDetector(LABELS)(frame_of(label[:, ::-1])).detections
    for a, b in zip(plain, image, strict=True):
        assert a.box[0] == WIDTH - b.box[2]
        assert a.pixels == b.pixels
        assert a.point[0] == pytest.approx(WIDTH - 1 - b.point[0], abs=1)
        assert a.distance == pytest.approx(b.distance, rel=0.01)


def test_the_most_frequent_colour_names_the_region():
    label, color = canvas(), np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    label[30:70, 20:60] = 1
    for word, rgb in PALETTE.items():
        color[30:70, 20:60] = (np.array(rgb) * 0.85 * 255).astype(np.uint8)
        color[30:45, 20:60] = (np.array(PALETTE["white"]) * 255).astype(np.uint8)
        (found,) = GroundTruthDetector(LABELS)(frame_of(label, color=color)).detections
        assert found.color == word
    assert set(PALETTE) == set(COLOR_WORDS)


@pytest.mark.parametrize("seed", range(5))
def test_permuted_labels_leave_no_class_in_its_place(seed):
    labels = load_world("flat").labels
    wrong = permuted_labels(labels, seed)
    assert wrong == permuted_labels(labels, seed)
    assert wrong != permuted_labels(labels, seed + 1)
    classes = {}
    for label, entry in labels.items():
        image = wrong[label]
        assert image.instance == entry.instance
        if entry.category == "wall":
            assert image == entry
        elif entry.category == "floor":
            assert image.category == "floor"
            assert image.room_kind != entry.room_kind
        else:
            assert image.category not in (entry.category, "floor", "wall")
            assert classes.setdefault(entry.category, image.category) == image.category
    assert len(set(classes.values())) == len(classes)
