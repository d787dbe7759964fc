"""What ``rules`` with dials perceives: how often each error is made, and to what."""

import dataclasses
import statistics

from rules_requests import PER_VIEW, request, seen, within

from unilavira_drake.messages import DIRECTIONS
from unilavira_drake.mllm.evidence import Detection, ViewEvidence
from unilavira_drake.mllm.request import DecisionNote, WaypointNote
from unilavira_drake.mllm.rules import RulesDials
from unilavira_drake.mllm.rules.confusion import SIMILAR, similar
from unilavira_drake.mllm.rules.perception import perceived
from unilavira_drake.mllm.rules.vocabulary import ROOMS, THINGS


def iou(a, b):
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    both = max(width, 0.0) * max(height, 0.0)
    areas = sum((c[2] - c[0]) * (c[3] - c[1]) for c in (a, b))
    return both / (areas - both)


def test_label_dropout_takes_its_share_of_each_view_and_number_alone():
    dropped = {n: 4 * PER_VIEW - len(seen(request(n), label_dropout=0.3)) for n in range(100)}
    assert within(sum(dropped.values()), 2000, 0.3)
    kept = [seen(request(n), label_dropout=0.3) for n in range(101)]
    both = sum(
        f"{d}#{i}" not in kept[n] and f"{d}#{i}" not in kept[n + 1]
        for n in range(100) for d in DIRECTIONS for i in range(PER_VIEW)
    )  # fmt: skip
    assert within(both, 2000, 0.09, sigmas=5.0)
    sides = sum(
        f"left#{i}" not in kept[n] and f"right#{i}" not in kept[n]
        for n in range(100) for i in range(PER_VIEW)
    )  # fmt: skip
    assert within(sides, 500, 0.09)
    assert not seen(request(1), label_dropout=1.0)


def test_box_jitter_moves_edges_by_its_share_and_leaves_those_on_the_border():
    moves, overlaps = [], []
    for n in range(100):
        before, after = seen(request(n)), seen(request(n), box_jitter=0.05)
        assert before.keys() == after.keys()
        for name, d in after.items():
            box, old = d.box, before[name].box
            moves += [(box[0] - old[0]) / 200.0, (box[3] - old[3]) / 120.0]
            overlaps.append(iou(box, old))
            assert (d.distance, d.pixels, d.category) == (2.5, 9000, "sofa")
    assert abs(statistics.fmean(moves)) < 0.003
    assert abs(statistics.stdev(moves) - 0.05) < 0.003
    assert 0.82 < statistics.fmean(overlaps) < 0.88
    cut = Detection(id="front#1", category="sofa", box=(0.0, 300.0, 640.0, 480.0))
    asked = request(1, evidence=(ViewEvidence("front", detections=(cut,)),))
    (box,) = [d.box for d in seen(asked, box_jitter=0.5).values()]
    assert (box[0], box[2], box[3]) == (0.0, 640.0, 480.0)
    assert box[1] != 300.0


def test_boxes_stay_in_the_picture_and_upright():
    for n in range(50):
        for d in seen(request(n), box_jitter=0.5).values():
            u_min, v_min, u_max, v_max = d.box
            assert 0.0 <= u_min <= u_max <= 640.0
            assert 0.0 <= v_min <= v_max <= 480.0
            assert 0.0 <= d.point[0] <= 639.0
            assert 0.0 <= d.point[1] <= 479.0


def test_confusion_takes_a_thing_for_each_similar_one():
    names = [
        d.category for n in range(100) for d in seen(request(n, category="couch"), confusion=0.4)
        .values()
    ]  # fmt: skip
    assert set(names) == {"couch", "armchair", "bench"}
    assert within(len(names) - names.count("couch"), 2000, 0.4)
    assert within(names.count("bench"), 2000, 0.2)


def test_confusion_changes_rooms_of_floors_and_nothing_without_a_likeness():
    floors = seen(request(1, category="floor"), confusion=1.0).values()
    assert {d.category for d in floors} == {"floor"}
    assert {d.room for d in floors} == {"storage room", "closet"}
    for lone in ("door", "person", "spaceship"):
        things = seen(request(1, category=lone), confusion=1.0).values()
        assert {(d.category, d.room) for d in things} == {(lone, "kitchen")}


def test_similar_names_are_canonical_and_in_one_group_each():
    names = [name for group in SIMILAR for name in group]
    assert len(names) == len(set(names))
    for group in SIMILAR:
        assert set(group) <= set(THINGS) or set(group) <= set(ROOMS)
    assert similar("sofa") == ("armchair", "bench")


def test_only_the_last_decisions_and_their_places_are_remembered():
    places = tuple(WaypointNote(id=i, distance=float(i), offered=True) for i in range(1, 7))
    notes = tuple(DecisionNote(n, f"at waypoint {n}: turn left: arrived") for n in range(1, 6))
    old = request(6).variables
    variables = dataclasses.replace(old, waypoints=places, decisions=notes, current_waypoint=6)
    asked = request(6, variables=variables)
    now = perceived(asked, RulesDials(forgets_after=2)).variables
    assert [note.n for note in now.decisions] == [4, 5]
    assert [note.id for note in now.waypoints] == [4, 5, 6]
    assert now.todo == variables.todo
    assert perceived(asked, RulesDials(forgets_after=5)) == asked
    ground = request(6, "ground")
    assert perceived(ground, RulesDials(forgets_after=1)) is ground
