import gc

import cv2
import numpy as np
import pytest
from pydrake.geometry import Box, ProximityProperties, RenderLabel, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.sensors import ImageDepth16U, ImageDepth32F, ImageLabel16I, ImageRgba8U
from two_cameras import TwoCameras, edited, instance, pose, quad, shapes, wall

from unilavira_drake import load_scenario
from unilavira_drake.raster import geometry
from unilavira_drake.raster.stage import shared_stage
from unilavira_drake.station import make_navigation_station

AHEAD = RigidTransform([3.0, 0.0, 0.0])
MIDDLE = (117, 163)  # The pixel nearest to the principal point.


def test_the_ports_are_those_of_drakes_camera():
    cameras = TwoCameras(shapes(wall()))
    ours, theirs = (
        {system.get_output_port(i).get_name() for i in range(system.num_output_ports())}
        for system in (cameras.camera, cameras.sensor)
    )
    assert ours == theirs
    cameras.look(pose(0.5, 0.1, 0.2, 0.3))
    context = cameras.camera.GetMyContextFromRoot(cameras.context)
    other = cameras.sensor.GetMyContextFromRoot(cameras.context)
    for name, kind in (
        ("color_image", ImageRgba8U),
        ("depth_image_32f", ImageDepth32F),
        ("depth_image_16u", ImageDepth16U),
        ("label_image", ImageLabel16I),
    ):
        image = cameras.camera.GetOutputPort(name).Eval(context)
        assert isinstance(image, kind)
        assert image.data.shape == cameras.sensor.GetOutputPort(name).Eval(other).data.shape
    (ours,), (theirs,) = cameras.ours("depth_image_16u"), cameras.theirs("depth_image_16u")
    assert np.abs(ours.astype(int) - theirs).max() <= 1
    for name in ("body_pose_in_world",):
        X = [
            system.GetOutputPort(name).Eval(c).GetAsMatrix4()
            for system, c in ((cameras.camera, context), (cameras.sensor, other))
        ]
        np.testing.assert_array_equal(*X)
    cameras.context.SetTime(2.5)
    assert cameras.camera.GetOutputPort("image_time").Eval(context) == [2.5]


def test_a_moving_body_is_seen_where_it_is():
    thing = instance(Box(0.5, 0.5, 0.5), label=7, name="thing")
    cameras = TwoCameras(shapes(wall()), thing=thing)
    cameras.look(pose(0, 0, 0))
    for x in (2.0, 3.0, 4.0):
        cameras.put(RigidTransform([x, 0, 0]))
        depth, label = cameras.ours("depth_image_32f", "label_image")
        assert depth[MIDDLE] == pytest.approx(x - 0.25, abs=1e-5)
        assert label[MIDDLE] == 7
    cameras.put(RigidTransform([3, 4, 0]))
    depth, label = cameras.ours("depth_image_32f", "label_image")
    assert (depth[MIDDLE], label[MIDDLE]) == (pytest.approx(4.95, abs=1e-5), 9)


def test_depth_alone_is_the_depth_beside_colour():
    cameras = TwoCameras(shapes(wall(), instance(Sphere(0.5), AHEAD, "ball")), vtk=False)
    cameras.look(pose(0, 0, 0, 0.2))
    (alone,) = cameras.ours("depth_image_32f")
    cameras.look(pose(0, 0, 0.0, 1.0))
    cameras.ours("color_image")
    cameras.look(pose(0, 0, 0, 0.2))
    _, beside = cameras.ours("color_image", "depth_image_32f")
    np.testing.assert_array_equal(alone, beside)


def test_depth_is_zero_too_close_and_infinite_too_far():
    cameras = TwoCameras(shapes(wall(12.0)), thing=instance(Box(0.02, 1, 1), name="thing"))
    cameras.look(pose(0, 0, 0))
    cameras.put(RigidTransform([0.08, 0.0, 0.0]))
    for images in (cameras.ours(), cameras.theirs()):
        assert images[1][MIDDLE] == 0.0
    cameras.put(RigidTransform([0, 0, -50.0]))
    for images in (cameras.ours(), cameras.theirs()):
        assert images[1][MIDDLE] == np.inf
        assert images[2][MIDDLE] == 9
    cameras.look(pose(0, 0, 0, np.pi))
    for images in (cameras.ours(), cameras.theirs()):
        assert images[1][MIDDLE] == np.inf
        assert images[2][MIDDLE] == int(RenderLabel.kEmpty)
        np.testing.assert_allclose(images[0][MIDDLE], (204, 229, 255, 255), atol=1)


def test_a_label_may_say_do_not_render():
    glass = instance(Box(0.02, 0.5, 0.5), AHEAD, "glass", label=RenderLabel.kDoNotRender)
    cameras = TwoCameras(shapes(glass, wall()), vtk=False)
    cameras.look(pose(0, 0, 0))
    color, depth, label = cameras.ours()
    assert depth[MIDDLE] == pytest.approx(2.99, abs=1e-5)
    assert label[MIDDLE] == 9
    assert color[MIDDLE][2] > color[MIDDLE][0]


def test_holes_of_a_masked_picture_show_what_is_behind():
    def mask(document):
        document["materials"][0]["alphaMode"] = "MASK"

    image = np.full((8, 8, 4), 255, np.uint8)
    image[:4, :, 3] = 0
    png = cv2.imencode(".png", image)[1].tobytes()
    mesh = edited(quad(), mask, quad_0__png=png)
    cameras = TwoCameras(
        shapes(wall(), instance(mesh, AHEAD, "leaf", label=3, color=None)), vtk=False
    )
    cameras.look(pose(0, 0, 0))
    for names in (("depth_image_32f",), ("color_image", "depth_image_32f")):
        depth = cameras.ours(*names)[-1]
        upper, lower = depth[MIDDLE[0] - 12, MIDDLE[1]], depth[MIDDLE[0] + 12, MIDDLE[1]]
        assert (upper, lower) == (pytest.approx(4.95, abs=1e-4), pytest.approx(3.0, abs=1e-4))
    (label,) = cameras.ours("label_image")
    assert (label[MIDDLE[0] - 12, MIDDLE[1]], label[MIDDLE[0] + 12, MIDDLE[1]]) == (9, 3)


def test_geometry_comes_and_goes_with_the_context():
    cameras = TwoCameras(shapes(wall()), vtk=False)
    cameras.look(pose(0, 0, 0))
    before = cameras.ours()
    graph = cameras.scene_graph
    changed = cameras.context.Clone()
    graph_context = graph.GetMyMutableContextFromRoot(changed)
    ball = instance(Sphere(0.5), AHEAD, "ball", label=4)
    # Poses of frames come from the plant: the ball hangs on one of its bodies.
    id_ = graph.RegisterGeometry(graph_context, cameras.source, cameras.thing_frame, ball)
    assert cameras.ours(context=changed)[2][MIDDLE] == 4
    for old, new in zip(before, cameras.ours(), strict=True):
        np.testing.assert_array_equal(old, new)
    graph.RemoveGeometry(graph_context, cameras.source, id_)
    for old, new in zip(before, cameras.ours(context=changed), strict=True):
        np.testing.assert_array_equal(old, new)


def test_a_shape_that_changes_under_its_id_is_seen():
    ball = instance(Sphere(0.5), AHEAD, "ball", label=4)
    ball.set_proximity_properties(ProximityProperties())
    cameras = TwoCameras(shapes(wall(), ball), vtk=False)
    cameras.look(pose(0, 0, 0))
    before = cameras.ours()
    changed = cameras.context.Clone()
    graph = cameras.scene_graph
    graph.ChangeShape(
        graph.GetMyMutableContextFromRoot(changed), cameras.source, ball.id(), Box(1.0, 1.0, 1.0)
    )
    for old, new in zip(before, cameras.ours(), strict=True):
        np.testing.assert_array_equal(old, new)
    label = [cameras.ours("label_image", context=c)[0] for c in (cameras.context, changed)]
    assert (label[1] == 4).sum() > 1.2 * (label[0] == 4).sum()


def test_all_views_of_a_rig_are_the_views_one_by_one():
    scene = shapes(
        wall(4.0), instance(Sphere(0.5), RigidTransform([0.2, 2.5, 0.3]), "ball", label=5)
    )
    rig = TwoCameras(scene, vtk=False, views=4)
    single = TwoCameras(scene, vtk=False)
    rig.look(pose(0, 0, 0.2, 0.1))
    for index in range(4):
        X = pose(0, 0, 0.2, 0.1).multiply(TwoCameras.turned(index, 4))
        single.look(X)
        names = ("color_image", "depth_image_32f", "label_image")
        together = rig.ours(*(f"view_{index}.{name}" for name in names))
        for one, other in zip(single.ours(*names), together, strict=True):
            # Poses differ by rounding, so a pixel on an edge may.
            assert np.isclose(one, other, atol=1e-5).mean() > 0.999


def test_frames_are_frozen_and_a_clone_shares_them():
    cameras = TwoCameras(shapes(wall()), vtk=False, views=4)
    cameras.look(pose(0, 0, 0))
    own = cameras.camera.GetMyContextFromRoot(cameras.context)
    frames = cameras.camera.frames(own)
    with pytest.raises(ValueError, match="read-only"):
        frames[0].depth[0, 0] = 1.0
    clone = cameras.camera.GetMyContextFromRoot(cameras.context.Clone())
    again = cameras.camera.frames(clone)
    assert all(a is b for a, b in zip(frames, again, strict=True))


@pytest.mark.parametrize("count", [0, 5000])
def test_no_geometry_and_very_many(count):
    boxes = [
        instance(Box(0.02, 0.02, 0.02), RigidTransform([4, y, z]), f"{y}_{z}", label=2)
        for y, z in (((i % 100 - 50) / 25, (i // 100 - 25) / 25) for i in range(count))
    ]
    cameras = TwoCameras(shapes(*boxes), vtk=False)
    cameras.look(pose(0, 0, 0.004))
    seen = (cameras.ours()[2] == 2).sum()
    assert seen == 0 if count == 0 else seen > 1000


def test_what_is_kept_on_the_graphics_side_is_bounded():
    stage = shared_stage()
    for index in range(12):
        parts = [wall(), instance(quad(1.0 + index), AHEAD, "quad", color=None)]
        cameras = TwoCameras(shapes(*parts), vtk=False)
        for angle in np.linspace(0, 6, 40):
            cameras.look(pose(0, 0, 0, angle))
            cameras.ours()
    gc.collect()
    assert stage.sizes() == (8, 8, 1)
    assert len(geometry._models) <= 9
    # A scene that made room for others is drawn as before.
    first = TwoCameras(shapes(wall()), vtk=False)
    first.look(pose(0, 0, 0))
    expected = first.ours()
    for index in range(9):
        TwoCameras(shapes(wall(2.0 + index)), vtk=False)
    first.look(pose(0, 0, 1.0))
    first.ours()
    first.look(pose(0, 0, 0))
    for one, other in zip(expected, first.ours(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_two_cameras_of_one_scene_share_its_triangles():
    stage = shared_stage()
    for _ in range(9):
        parts = [wall(3.0), instance(quad(), AHEAD, "quad", color=None)]
        TwoCameras(shapes(*parts), vtk=False)
    gc.collect()
    assert stage.sizes() == (8, 1, 1)


def test_the_station_draws_the_same_for_every_clone():
    scenario = load_scenario("flat", "renderer: raster")
    station = make_navigation_station(scenario)
    context = station.CreateDefaultContext()
    names = ("front.color_image", "front.depth_image", "front.label_image")
    clone = context.Clone()
    first = [station.GetOutputPort(name).Eval(context).data.copy() for name in names]
    plant = station.GetSubsystemByName("plant")
    q = np.array([3.0, 5.0, 0.4])
    for other in (context, clone):
        plant.SetPositions(plant.GetMyMutableContextFromRoot(other), q)
    moved = [station.GetOutputPort(name).Eval(context).data.copy() for name in names]
    assert not np.array_equal(first[0], moved[0])
    for name, expected in zip(names, moved, strict=True):
        np.testing.assert_array_equal(station.GetOutputPort(name).Eval(clone).data, expected)
    assert RollPitchYaw(station.GetOutputPort("front.X_BC").Eval(context).rotation()).vector().any()
