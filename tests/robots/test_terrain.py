"""Bodies that follow the ground: models, and a way up the stairs of a house."""

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake.errors import ScenarioError
from unilavira_drake.resources import models_path
from unilavira_drake.robots.cobot_magic import CobotMagic
from unilavira_drake.robots.terrain import GRAVITY, STIFFNESS, TerrainFollower, climbing_model
from unilavira_drake.robots.unitree_g1 import UnitreeG1
from unilavira_drake.robots.unitree_go1 import UnitreeGo1
from unilavira_drake.scenario import Scenario, WorldChoice
from unilavira_drake.station import make_navigation_station
from unilavira_drake.worlds.load import load_world

HOUSE = load_world("two_storey")
STAIRS = HOUSE.stairs[0]


def test_a_height_joint_between_the_planar_base_and_the_body() -> None:
    model = climbing_model(models_path() / "robots" / "cobot_magic.sdf")
    assert model.count("base_height") == 1
    assert model.count('name="lift"') == 1


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("bare.sdf", "<sdf><model name='bare'/></sdf>", "base_yaw"),
        ("cart.urdf", "<robot name='cart'><joint name='base_yaw'/></robot>", "SDF"),
        ("torn.sdf", "<sdf>", "no SDF"),
    ],
)
def test_a_model_that_cannot_climb_is_named(tmp_path, name, text, words) -> None:
    path = tmp_path / name
    path.write_text(text)
    scenario = Scenario(
        world=WorldChoice("two_storey"), robot=UnitreeG1(model=str(path), can_climb=True)
    )
    with pytest.raises(ScenarioError, match=words) as error:
        make_navigation_station(scenario, world=HOUSE, start=(6.0, 2.0, 0.0))
    assert name in str(error.value)


def test_meshes_beside_the_model_are_found(tmp_path) -> None:
    text = (models_path() / "robots" / "unitree_g1.sdf").read_text(encoding="utf-8")
    mesh = "<geometry><mesh><uri>meshes/lid.obj</uri></mesh></geometry>"
    link = '<link name="base">'
    assert text.count(link) == 1
    visual = f'<visual name="lid">{mesh}</visual>'
    path = tmp_path / "own_g1.sdf"
    path.write_text(text.replace(link, link + visual))
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "lid.obj").write_text("v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n")
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), 0.001)
    parser = Parser(plant)
    (instance,) = parser.AddModelsFromString(climbing_model(path), "sdf")
    geometries = plant.GetVisualGeometriesForBody(plant.GetBodyByName("base", instance))
    names = [scene_graph.model_inspector().GetName(geometry) for geometry in geometries]
    assert any("lid" in name for name in names)


def test_the_locomotion_sees_level_ground() -> None:
    joints = ["base_x", "base_y", "base_yaw", "base_height", "hip"]
    follower = TerrainFollower(
        joints=joints,
        actuated=["base_x", "base_y", "base_yaw", "base_height", "hip"],
        ground_height=lambda x, y, z: 10.0 * x + y + z,
    )
    context = follower.CreateDefaultContext()
    follower.GetInputPort("joint_state").FixValue(context, np.arange(1.0, 11.0))
    follower.GetInputPort("desired_level_joint_state").FixValue(context, np.arange(-8.0, 0.0))
    level = follower.GetOutputPort("level_joint_state").Eval(context)
    assert level.tolist() == [1, 2, 3, 5, 6, 7, 8, 10]
    # With what the servo sinks under the weight.
    height = 10 + 2 + 4 + GRAVITY / STIFFNESS
    desired = follower.GetOutputPort("desired_joint_state").Eval(context)
    assert desired.tolist() == [-8, -7, -6, height, -5, -4, -3, -2, 0, -1]


@pytest.mark.parametrize("robot", [UnitreeGo1, UnitreeG1, CobotMagic])
def test_up_the_stairs_and_a_camera_that_comes_along(robot) -> None:
    scenario = Scenario(world=WorldChoice("two_storey"), robot=robot(can_climb=True))
    x, y = STAIRS.point(-0.6)
    station = make_navigation_station(scenario, world=HOUSE, start=(x, y, np.pi / 2))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("base_command").FixValue(context, [0.4, 0.0, 0.0])
    heights = []
    while context.get_time() < 20.0:
        simulator.AdvanceTo(context.get_time() + 0.5)
        X_WB = station.GetOutputPort("pose_estimate").Eval(context)
        x, y, z = X_WB.translation()
        assert z == pytest.approx(HOUSE.ground_height(x, y, z), abs=0.07)
        heights.append(z)
        if y > STAIRS.head[1] + 0.8:
            break
    # A gait shakes it by a few millimetres.
    assert min(np.diff(heights)) > -0.01
    assert heights[-1] == pytest.approx(STAIRS.top, abs=0.02)
    contacts = station.GetOutputPort("contact_results").Eval(context)
    assert contacts.num_point_pair_contacts() == 0


def test_a_start_on_the_upper_floor_stays_there() -> None:
    scenario = Scenario(world=WorldChoice("two_storey"), robot=UnitreeGo1(can_climb=True))
    scenario.task.text, scenario.task.start = "Stop.", "bathroom"
    station = make_navigation_station(scenario)
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("base_command").FixValue(context, np.zeros(3))
    simulator.AdvanceTo(1.0)
    z = station.GetOutputPort("cheat_X_WB").Eval(context).translation()[2]
    assert z == pytest.approx(2.8, abs=1e-3)
