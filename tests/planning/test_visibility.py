"""Flight plans: limits, snapping, and the distance to true obstacles by Drake's own geometry."""

import itertools
import math

import flight_worlds as worlds
import numpy as np
import pytest
from pydrake.geometry import (
    Box,
    GeometryInstance,
    ProximityProperties,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

from unilavira_drake.messages import VoxelMap
from unilavira_drake.planning.visibility import (
    NO_WAY_OUT,
    TOO_MANY,
    UNREACHABLE,
    FlightParameters,
    make_flight_plan,
)
from unilavira_drake.planning.visibility_path import path_is_blocked, remaining_way
from unilavira_drake.planning.visibility_space import Clearance, FlightSpace, update_space

SIZE = Clearance(0.6, 1.2, 0.8)
PARAMETERS = FlightParameters(clearance=SIZE, min_altitude=1.0, max_altitude=20.0)
GROUND = (-40.0, -40.0, -1.0, 40.0, 40.0, 0.0)


def plan(boxes, position, target, parameters=PARAMETERS, **named):
    space = worlds.space_of(boxes, parameters.clearance)
    named = {"viewpoint": position, **named}
    return make_flight_plan(space, position=position, target=target, parameters=parameters, **named)


def flights(count):
    """Yields random worlds with a plan in each."""
    rng = np.random.default_rng(11)
    while count > 0:
        boxes = worlds.random_boxes(rng)
        ends = np.array([(-18.0, -17.0, 3.0), (17.5, 18.0, 5.0)])
        ends += rng.uniform(-2.0, 2.0, ends.shape)
        if (worlds.distance_to(boxes, ends) < 2.5).any():
            continue
        count -= 1
        found = plan(boxes, tuple(ends[0]), tuple(ends[1]))
        assert not found.reason
        yield boxes, found


def register(graph, boxes):
    source = graph.RegisterSource("world")
    for k, box in enumerate(boxes):
        low, high = np.array(box[:3]), np.array(box[3:])
        shape = GeometryInstance(RigidTransform(0.5 * (low + high)), Box(*(high - low)), f"box_{k}")
        shape.set_proximity_properties(ProximityProperties())
        graph.RegisterAnchoredGeometry(source, shape)


def test_the_radius_is_kept_from_the_true_boxes_by_scene_graph():
    for boxes, found in flights(12):
        graph = SceneGraph()
        register(graph, boxes)
        query = graph.get_query_output_port().Eval(graph.CreateDefaultContext())
        points = worlds.along(found.p_WP, 0.2)
        distances = [
            min(found.distance for found in query.ComputeSignedDistanceToPoint(p)) for p in points
        ]
        assert min(distances) >= SIZE.radius - 1e-9
        np.testing.assert_allclose(distances, worlds.distance_to(boxes, points), atol=1e-9)


def checker_of(boxes):
    """Drake's collision checker of a sphere that moves along x, y and z."""
    builder = RobotDiagramBuilder(time_step=0.0)
    plant = builder.plant()
    model = plant.AddModelInstance("aircraft")
    inertia = SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(0.1))
    parent = plant.world_frame()
    for axis in range(3):
        body = plant.AddRigidBody(f"b{axis}", model, inertia)
        joint = PrismaticJoint(f"j{axis}", parent, body.body_frame(), np.eye(3)[axis], -100, 100)
        plant.AddJoint(joint)
        parent = body.body_frame()
    # A hair less than the radius: touching is allowed.
    shape = Sphere(SIZE.radius - 1e-6)
    plant.RegisterCollisionGeometry(body, RigidTransform(), shape, "hull", ProximityProperties())
    for k, box in enumerate(boxes):
        low, high = np.array(box[:3]), np.array(box[3:])
        plant.RegisterCollisionGeometry(
            plant.world_body(),
            RigidTransform(0.5 * (low + high)),
            Box(*(high - low)),
            f"box_{k}",
            ProximityProperties(),
        )
    plant.Finalize()
    return SceneGraphCollisionChecker(
        model=builder.Build(),
        robot_model_instances=[model],
        edge_step_size=0.05,
        env_collision_padding=0.0,
        self_collision_padding=0.0,
    )


def test_every_edge_is_free_by_drakes_collision_checker():
    for boxes, found in flights(4):
        checker = checker_of(boxes)
        for a, b in itertools.pairwise(found.p_WP):
            assert checker.CheckEdgeCollisionFree(a, b)
        # The checker does see the boxes.
        assert not checker.CheckConfigCollisionFree(np.array(found.p_WP[0]) * (1, 1, 0))


def test_limits_of_altitude_climb_descent_and_margins_are_kept():
    for boxes, found in flights(12):
        angles = worlds.slopes(found.p_WP)
        assert np.abs(angles).max(initial=0.0) <= math.radians(45.0) + 1e-9
        points = worlds.along(found.p_WP)
        assert points[:, 2].min() >= 1.2 - 1e-9
        assert points[:, 2].max() <= 20.0 + 1e-9
        for x0, y0, z0, x1, y1, z1 in boxes:
            above = (points[:, :2] > (x0, y0)).all(1) & (points[:, :2] < (x1, y1)).all(1)
            heights = points[above, 2]
            assert not ((heights > z0) & (heights < z1 + SIZE.ground_margin - 1e-9)).any()
            assert not ((heights < z1) & (heights > z0 - SIZE.ceiling_margin + 1e-9)).any()
        lengths = np.linalg.norm(np.diff(found.p_WP, axis=0), axis=1)
        assert found.length == pytest.approx(lengths.sum())


def test_unknown_space_is_flown_through():
    found = make_flight_plan(
        FlightSpace(clearance=SIZE),
        position=(0.0, 0.0, 5.0),
        target=(100.0, 30.0, 8.0),
        viewpoint=(0.0, 0.0, 5.0),
        parameters=PARAMETERS,
    )
    np.testing.assert_allclose(found.p_WP, [(0, 0, 5), (100, 30, 8)], atol=1e-12)


def test_a_steep_goal_is_reached_by_switchbacks():
    found = plan([GROUND], (0.0, 0.0, 3.0), (0.0, 0.0, 15.0))
    assert found.length == pytest.approx(12.0 / math.sin(math.radians(45.0)))
    np.testing.assert_allclose(found.p_WP[-1], (0.0, 0.0, 15.0))
    free = FlightParameters(
        clearance=SIZE, min_altitude=1.0, max_altitude=20.0, climb_angle=0.5 * math.pi
    )
    assert len(plan([GROUND], (0.0, 0.0, 3.0), (0.0, 0.0, 15.0), free).p_WP) == 2


def test_a_target_on_a_wall_is_snapped_to_the_side_it_was_seen_from():
    wall = (10.0, -20.0, 0.0, 11.0, 20.0, 12.0)
    for x, side in ((0.0, 10.0), (22.0, 11.0)):
        found = plan([GROUND, wall], (x, 0.0, 4.0), (10.5, 0.2, 4.0))
        end = found.p_WP[-1]
        assert (end[0] < 10.5) == (side == 10.0)
        assert 0.6 <= abs(end[0] - side) <= 1.5
        assert np.abs(end[1:] - (0.2, 4.0)).max() <= 0.5


def test_a_target_on_the_ground_is_snapped_to_the_lowest_altitude():
    found = plan([GROUND], (0.0, 0.0, 4.0), (12.0, 3.0, 0.0))
    assert 1.2 <= found.p_WP[-1, 2] <= 2.0
    assert math.dist(found.p_WP[-1, :2], (12.0, 3.0)) <= 0.5


def test_a_goal_is_never_snapped_onto_the_aircraft():
    cube = (3.0, -4.0, 0.0, 30.0, 4.0, 19.0)
    found = plan([GROUND, cube], (2.2, 0.0, 5.0), (4.3, 0.0, 5.0))
    assert math.dist(found.p_WP[-1], (2.2, 0.0, 5.0)) >= 1.0


def test_a_goal_snapped_before_is_kept_while_it_is_free():
    boxes = [GROUND, (10.0, -20.0, 0.0, 11.0, 20.0, 12.0)]
    kept = (8.0, 0.5, 4.5)
    found = plan(boxes, (0.0, 0.0, 4.0), (10.5, 0.2, 4.0), goal=kept)
    np.testing.assert_allclose(found.p_WP[-1], kept)
    again = plan(boxes, (0.0, 0.0, 4.0), (10.5, 0.2, 4.0), goal=(10.5, 0.0, 4.0))
    assert again.p_WP[-1, 0] < 10.0


def chest(x, y, size=8.0):
    """A closed room around (x, y, 5): floor, ceiling, four walls."""
    a, b = x - size / 2, x + size / 2
    c, d = y - size / 2, y + size / 2
    return [
        (a, c, 0.0, b, d, 0.5),
        (a, c, 9.5, b, d, 10.0),
        (a, c, 0.0, a + 0.5, d, 10.0),
        (b - 0.5, c, 0.0, b, d, 10.0),
        (a, c, 0.0, b, c + 0.5, 10.0),
        (a, d - 0.5, 0.0, b, d, 10.0),
    ]


@pytest.mark.parametrize("inside", [True, False])
def test_what_is_closed_in_is_unreachable(inside):
    points = (0.0, 0.0, 5.0), (16.0, 0.0, 5.0)
    position, target = points if inside else points[::-1]
    assert plan([GROUND, *chest(0.0, 0.0)], position, target).reason == UNREACHABLE


def test_another_place_within_the_bound_is_taken_when_the_nearest_is_closed_in():
    parameters = FlightParameters(
        clearance=SIZE, min_altitude=1.0, max_altitude=20.0, snap_distance=6.0
    )
    boxes = [GROUND, *chest(16.0, 0.0)]
    assert plan(boxes, (0.0, 0.0, 5.0), (16.0, 0.0, 5.0)).reason == UNREACHABLE
    found = plan(boxes, (0.0, 0.0, 5.0), (16.0, 0.0, 5.0), parameters)
    assert not found.reason
    assert 4.0 < math.dist(found.p_WP[-1], (16.0, 0.0, 5.0)) <= 6.0


def test_a_long_wall_is_gone_around_in_the_larger_window():
    wall = (10.0, -38.0, 0.0, 11.0, 38.0, 30.0)
    found = plan([GROUND, wall], (0.0, 0.0, 4.0), (22.0, 0.0, 4.0))
    assert not found.reason
    assert found.length >= 2 * math.dist((10.0, 38.6), (0.0, 0.0)) - 10.0


def test_a_goal_behind_a_wall_is_gone_to_and_not_given_up_before_it():
    wall = (0.0, -35.0, 0.0, 0.5, 35.0, 25.0)
    target = (1.75, 0.25, 3.25)
    found = plan([GROUND, wall], (-4.0, 0.0, 3.0), target)
    assert not found.reason
    np.testing.assert_allclose(found.p_WP[-1], target, atol=0.5)
    assert np.abs(found.p_WP[:, 1]).max() > 35.0


def test_an_aircraft_on_the_ground_takes_off():
    found = plan([GROUND], (0.0, 0.0, 0.2), (20.0, 0.0, 4.0))
    np.testing.assert_allclose(found.p_WP[0], (0.0, 0.0, 0.2))
    assert 1.2 <= found.p_WP[1, 2] <= 2.3
    assert np.abs(found.p_WP[1, :2]).max() <= 0.5


def test_an_aircraft_walled_in_says_so():
    block = [(-4, -4, 0, 4, 4, 2.5), (-4, -4, 3.5, 4, 4, 9)]
    block += [(-4, -4, 0, -0.5, 4, 9), (0.5, -4, 0, 4, 4, 9)]
    block += [(-4, -4, 0, 4, -0.5, 9), (-4, 0.5, 0, 4, 4, 9)]
    assert plan(block, (0.0, 0.0, 3.0), (20.0, 0.0, 4.0)).reason == NO_WAY_OUT


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ((0.0, 0.0, math.nan), "finite"),
        ((300.0, 0.0, 5.0), "200 m"),
        ((10.0, 0.0, 80.0), "no free space within 3 m"),
    ],
)
def test_targets_that_make_no_sense_fail_with_the_reason(target, words):
    assert words in plan([GROUND], (0.0, 0.0, 5.0), target).reason


def test_a_window_too_large_to_search_says_so():
    space = update_space(
        FlightSpace(clearance=Clearance(0.05, 0.05, 0.05)), VoxelMap(version=1, resolution=0.01)
    )
    found = make_flight_plan(
        space,
        position=(0.0, 0.0, 5.0),
        target=(150.0, 90.0, 5.0),
        viewpoint=(0.0, 0.0, 5.0),
        parameters=PARAMETERS,
    )
    assert found.reason == TOO_MANY


@pytest.mark.parametrize(
    "named",
    [
        {"min_altitude": 9.0, "max_altitude": 2.0},
        {"climb_angle": 0.0},
        {"descend_angle": 3.0},
        {"snap_distance": -1.0},
        {"max_altitude": math.inf},
        {"narrow_radius": 0.0},
    ],
)
def test_limits_that_make_no_sense_are_refused(named):
    with pytest.raises(ValueError, match="must"):
        FlightParameters(**named)


def test_the_rest_of_a_path_is_checked():
    p_WP = np.array([(0.0, 0.0, 4.0), (10.0, 0.0, 4.0), (10.0, 10.0, 4.0)])
    clear = worlds.space_of([GROUND], SIZE)
    behind = worlds.space_of([GROUND, (-2.0, -1.0, 0.0, 1.0, 1.0, 9.0)], SIZE)
    ahead = worlds.space_of([GROUND, (9.0, 5.0, 0.0, 11.0, 6.0, 9.0)], SIZE)
    here = (5.0, 0.1, 4.0)
    assert not path_is_blocked(clear, p_WP, position=here)
    assert not path_is_blocked(behind, p_WP, position=here)
    # An aircraft too near to something is on its way out.
    assert not path_is_blocked(behind, p_WP, position=(0.0, 0.0, 4.0))
    assert path_is_blocked(ahead, p_WP, position=here)
    assert not path_is_blocked(ahead, p_WP, position=(10.0, 8.0, 4.0))
    both = worlds.space_of([GROUND, (-2, -1, 0, 0.2, 1, 9), (4, -1, 0, 5, 1, 9)], SIZE)
    assert path_is_blocked(both, p_WP, position=(0.5, 0.0, 4.0))
    far = np.array([(0.0, 0.0, 4.0), (390.0, 20.0, 4.0)])
    assert not path_is_blocked(clear, far, position=(0.0, 0.0, 4.0))
    pole = worlds.space_of([(300.0, 15.0, 0.0, 300.5, 16.0, 9.0)], SIZE)
    assert path_is_blocked(pole, far, position=(0.0, 0.0, 4.0))


def test_the_remaining_way_is_the_closed_form():
    p_WP = np.array([(0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (10.0, 0.0, 5.0)])
    assert remaining_way(p_WP, (4.0, 3.0, 0.0)) == (pytest.approx(3.0 + 6.0 + 5.0), 1)
    assert remaining_way(p_WP, (10.0, 0.0, 2.0)) == (pytest.approx(3.0), 2)
    assert remaining_way(p_WP[:1], (3.0, 4.0, 0.0)) == (pytest.approx(5.0), 0)
    assert remaining_way(p_WP[:0], (3.0, 4.0, 0.0)) == (0.0, 0)
