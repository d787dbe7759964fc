import itertools
import math

import numpy as np
import pytest
from pydrake.geometry import QueryObject, Role, SceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.diagram import make_navigation_diagram
from unilavira_drake.errors import TaskError
from unilavira_drake.messages import Frame
from unilavira_drake.robots.planar_base import planar_pose
from unilavira_drake.robots.quadrotor import Quadrotor
from unilavira_drake.robots.unitree_go1 import UnitreeGo1
from unilavira_drake.scenario import NamedTask, Scenario, TaskChoice, WorldChoice
from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.sensors.detections import GroundTruthDetector
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.sensors.scene_camera import SceneCamera
from unilavira_drake.station import add_navigation_station, make_navigation_station
from unilavira_drake.task_choice import start_pose
from unilavira_drake.worlds.load import load_world

WORLD = load_world("flat")


class Rig:
    """A station alone, with a fixed command."""

    def __init__(self, scenario=None, world=WORLD, start=(2.9, 7.4, -math.pi / 2)):
        builder = DiagramBuilder()
        scenario = scenario or small_scenario()
        pose = None if start is None else planar_pose(*start)
        self.station = add_navigation_station(builder, scenario, world, X_WB_start=pose)
        builder.ExportInput(self.station.GetInputPort("base_command"), "base_command")
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.command(0.0, 0.0, 0.0)
        self.intrinsics = front_intrinsics(scenario.robot)

    def command(self, *twist):
        self.diagram.get_input_port(0).FixValue(self.context, np.array(twist))

    def read(self, port):
        context = self.station.GetMyContextFromRoot(self.context)
        return self.station.GetOutputPort(port).Eval(context)

    def drive(self, duration, *twist):
        self.command(*twist)
        self.simulator.AdvanceTo(self.context.get_time() + duration)
        X_WB = self.read("pose_estimate")
        x, y, _ = X_WB.translation()
        return x, y, X_WB.rotation().ToRollPitchYaw().yaw_angle()

    def place(self, x, y, yaw):
        plant = self.station.GetSubsystemByName("plant")
        plant.SetPositions(plant.GetMyMutableContextFromRoot(self.context), [x, y, yaw])
        self.drive(0.01, 0.0, 0.0, 0.0)

    def frame(self):
        X_WC = self.read("pose_estimate").multiply(self.read("front.X_BC")).GetAsMatrix4()
        return Frame(
            color=np.array(self.read("front.color_image").data[:, :, :3]),
            depth=np.array(self.read("front.depth_image").data[:, :, 0]),
            label=np.array(self.read("front.label_image").data[:, :, 0]),
            intrinsics=self.intrinsics,
            X_WC=X_WC,
        )


def small_scenario(width=320, height=240):
    scenario = Scenario()
    scenario.robot.image_width, scenario.robot.image_height = width, height
    return scenario


@pytest.fixture(scope="module")
def rig():
    return Rig()


def test_ports_are_the_contracts(rig):
    station = rig.station
    assert station.get_name() == "station"
    assert [station.get_input_port(i).get_name() for i in range(station.num_input_ports())] == [
        "base_command"
    ]
    assert {station.get_output_port(i).get_name() for i in range(station.num_output_ports())} == {
        "front.color_image",
        "front.depth_image",
        "front.label_image",
        "front.X_BC",
        "pose_estimate",
        "twist",
        "contact_results",
        "cheat_X_WB",
    }
    assert not station.HasAnyDirectFeedthrough()


def test_the_camera_is_a_metre_up_and_looks_ten_degrees_down(rig):
    X_BC = rig.read("front.X_BC")
    assert X_BC.translation()[2] == pytest.approx(1.0)
    forward = X_BC.rotation().matrix()[:, 2]
    assert forward == pytest.approx(
        [math.cos(math.radians(10)), 0, -math.sin(math.radians(10))], abs=1e-9
    )
    right = X_BC.rotation().matrix()[:, 0]
    assert right == pytest.approx([0, -1, 0], abs=1e-9)


def test_depth_and_labels_agree_with_the_world():
    rig = Rig(start=(7.0, 2.4, math.pi / 2))
    frame = rig.frame()
    k = rig.intrinsics
    v, u = np.indices(frame.depth.shape)
    p_C = np.stack(((u - k.cx) / k.fx, (v - k.cy) / k.fy, np.ones(u.shape)), -1)
    p_W = (p_C * frame.depth[..., None]) @ frame.X_WC[:3, :3].T + frame.X_WC[:3, 3]
    floor = frame.label == WORLD.label_of("kitchen_floor")
    assert floor.sum() > 1000
    assert np.abs(p_W[floor][:, 2]).max() < 1e-3
    room = WORLD.room("kitchen").rectangle
    assert p_W[floor][:, 0].min() > room[0]
    assert p_W[floor][:, 1].max() < room[3] + 0.01
    walls = frame.label == WORLD.label_of("walls")
    ahead = walls & (p_W[..., 2] < 1.5) & (p_W[..., 1] < 4.3)
    assert np.median(p_W[ahead][:, 1]) == pytest.approx(4.15, abs=1e-3)


def test_the_robot_is_not_in_its_own_view(rig):
    scene_graph = next(s for s in rig.station.GetSystems() if isinstance(s, SceneGraph))
    inspector = scene_graph.model_inspector()
    mine = [
        geometry
        for geometry in inspector.GetAllGeometryIds()
        if inspector.GetName(geometry).startswith("cobot_magic::")
    ]
    assert len(mine) > 5
    assert all(inspector.GetPerceptionProperties(geometry) is None for geometry in mine)
    # Nor would the real one be: whatever is ahead of the camera lies below its lowest ray.
    X_BC = rig.read("front.X_BC")
    half_height = math.atan((rig.intrinsics.cy + 0.5) / rig.intrinsics.fy) + math.radians(10)
    context = scene_graph.GetMyContextFromRoot(rig.context)
    query = scene_graph.get_query_output_port().Eval(context)
    assert isinstance(query, QueryObject)
    for geometry in mine:
        if inspector.GetProximityProperties(geometry) is not None:
            continue
        obb = inspector.GetObbInGeometryFrame(geometry)
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        p_GV = obb.pose().multiply((signs * obb.half_width()).T)
        p_CV = (inspector.GetPoseInFrame(geometry).multiply(p_GV)).T - X_BC.translation()
        for ahead, _, above in p_CV[p_CV[:, 0] > 0]:
            assert math.atan2(-above, ahead) > half_height
    assert inspector.NumGeometriesWithRole(Role.kIllustration) > len(mine) // 2


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((2.2, 2.3, -math.pi / 2), {("sofa", "red")}),
        ((2.0, 2.2, math.pi), {("armchair", "orange"), ("plant", "green")}),
        ((7.6, 2.4, -math.pi / 2), {("counter", "orange"), ("stove", "black")}),
        ((7.8, 1.9, -0.5), {("refrigerator", "white")}),
        ((11.2, 2.4, -math.pi / 2), {("bathtub", "pink")}),
        ((11.4, 2.8, 0.0), {("sink", "blue"), ("washing machine", "gray")}),
        ((2.2, 5.0, 0.0), {("bench", "red"), ("door", "cyan")}),
        ((6.8, 8.0, 0.2), {("desk", "brown"), ("chair", "red"), ("monitor", "black")}),
        ((10.4, 7.2, 0.9), {("table", "purple"), ("chair", "yellow")}),
        ((3.2, 7.2, 0.6), {("wardrobe", "brown")}),
        ((3.3, 7.2, -0.8), {("lamp", "pink")}),
    ],
)
def test_colour_words_from_the_pixels_are_the_declared_ones(rig, place, expected):
    rig.place(*place)
    frame = rig.frame()
    detections = GroundTruthDetector(WORLD.labels)(frame).detections
    assert expected <= {(d.category, d.color) for d in detections}
    # Whatever is seen well has the colour that its file says.
    declared = {(thing.category, thing.color) for thing in WORLD.objects}
    for detection in detections:
        if detection.category != "floor" and detection.pixels > 400:
            assert (detection.category, detection.color) in declared
    assert frame.color[frame.label == WORLD.label_of("walls")].min() > 90


def test_the_base_follows_its_command():
    rig = Rig(start=(1.5, 5.0, 0.0))
    rig.drive(0.5, 0.5, 0.0, 0.0)
    x, _, _ = rig.drive(0.0, 0.5, 0.0, 0.0)
    # Outputs are sampled once per time step of 25 ms, hence the tolerance.
    x_end, y, yaw = rig.drive(2.0, 0.5, 0.3, 0.0)
    assert x_end - x == pytest.approx(1.0, abs=0.02)
    assert (y, yaw) == pytest.approx((5.0, 0.0), abs=1e-6)
    assert rig.read("twist") == pytest.approx([0, 0, 0, 0.5, 0, 0], abs=1e-3)
    rig.drive(0.5, 0.0, 0.0, 0.8)
    _, _, before = rig.drive(0.0, 0.0, 0.0, 0.8)
    _, _, after = rig.drive(1.0, 0.0, 0.0, 0.8)
    assert after - before == pytest.approx(0.8, abs=0.021)


@pytest.mark.parametrize(
    ("start", "limit"),
    [((7.5, 2.2, math.pi / 2 + 0.9), 0.01), ((7.0, 5.0, math.pi / 2), 0.01)],
)
def test_at_a_wall_the_base_stalls_and_never_passes(start, limit):
    rig = Rig(start=start)
    rig.drive(6.0, 1.8, 0.0, 0.0)
    a = np.array(rig.drive(0.0, 1.8, 0.0, 0.0))
    b = np.array(rig.drive(4.0, 1.8, 0.0, 0.0))
    assert np.hypot(*(b - a)[:2]) < limit
    room = WORLD.room_at(start[0], start[1])
    assert room is WORLD.room_at(b[0], b[1])
    results = rig.read("contact_results")
    assert results.num_point_pair_contacts() > 0
    total = sum(
        np.linalg.norm(results.point_pair_contact_info(i).contact_force())
        for i in range(results.num_point_pair_contacts())
    )
    assert 100.0 < total < 1000.0


@pytest.mark.parametrize("angle", [-1.2, -0.8, 0.0, 0.8, 1.0])
def test_a_base_that_goes_on_pushing_does_not_creep_into_the_wall(angle):
    rig = Rig(start=(7.5, 2.2, math.pi / 2 + angle))
    deepest = 0.0
    for _ in range(24):
        rig.drive(0.25, 0.8, 0.0, 0.0)
        results = rig.read("contact_results")
        depths = [
            results.point_pair_contact_info(i).point_pair().depth
            for i in range(results.num_point_pair_contacts())
        ]
        deepest = max([deepest, *depths])
    assert 0.0 < deepest < 0.02


def test_images_are_rendered_only_when_pulled(monkeypatch):
    drawn = []
    render = SceneCamera._render

    def counted(self, name, context, output):
        drawn.append(name)
        render(self, name, context, output)

    monkeypatch.setattr(SceneCamera, "_render", counted)
    scenario = small_scenario()
    scenario.renderer = "vtk"
    rig = Rig(scenario)
    rig.drive(0.5, 0.3, 0.0, 0.0)
    assert drawn == []
    rig.read("front.depth_image")
    rig.read("front.depth_image")
    assert drawn == ["front.depth_image"]


def test_the_scenario_alone_is_enough():
    scenario = small_scenario()
    scenario.world = WorldChoice(name="flat")
    scenario.tasks = {"go": NamedTask(text="Go to the red sofa.", start="kitchen")}
    scenario.default_task = "go"
    rig = Rig(scenario, world=None, start=None)
    x, y, yaw = rig.drive(0.01, 0.0, 0.0, 0.0)
    assert WORLD.room_at(x, y).name == "kitchen"
    assert yaw == 0.0
    scenario.task = TaskChoice(start="1.6,0.5,0")
    with pytest.raises(TaskError, match="inside sofa_1"):
        Rig(scenario, world=None, start=None)


def test_a_mirrored_station_shows_the_mirrored_view():
    scenario = small_scenario()
    scenario.world = WorldChoice(name="flat", mirror=True)
    scenario.task = TaskChoice(text="Go.", start="6.8,8.0,0.2")
    mirror = Rig(scenario, world=None, start=None).frame()
    plain = Rig(start=(6.8, 8.0, 0.2)).frame()
    same = plain.label == mirror.label[:, ::-1]
    assert same.mean() > 0.99
    inside = same & np.isfinite(plain.depth)
    difference = np.abs(plain.depth - mirror.depth[:, ::-1])[inside]
    assert np.median(difference) < 1e-4
    colors = np.abs(plain.color.astype(int) - mirror.color[:, ::-1].astype(int))[same]
    assert np.median(colors) <= 1


@pytest.mark.parametrize("make", [make_navigation_station, make_navigation_diagram])
def test_an_aircraft_upstairs_is_refused_by_whoever_builds_it(make):
    # Changed after it was read, so that no check of the file has seen it.
    scenario = load_scenario("two_storey")
    scenario.task.start = "7.0,8.4,2.8,1.57"
    scenario.robot = UnitreeGo1(can_climb=True)
    assert start_pose(scenario, load_world("two_storey")) == (7.0, 8.4, 2.8, 1.57)
    scenario.robot = Quadrotor()
    with pytest.raises(TaskError, match="takes off from the ground floor"):
        make(scenario)
