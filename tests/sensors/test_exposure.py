"""Exposure: a gain for each picture, or the first one's for all."""

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import ImageRgba8U

from unilavira_drake.scenario_loading import load_scenario
from unilavira_drake.sensors.exposure import ExposureControl, exposed, gain_for
from unilavira_drake.sensors.exposure_config import ExposureConfig
from unilavira_drake.station import make_navigation_station


def picture(*rgb):
    image = ImageRgba8U(8, 8)
    image.mutable_data[:] = (*rgb, 255)
    return image


class Bench:
    """An exposure control of two views whose pictures are set by hand."""

    def __init__(self, mode):
        self.control = ExposureControl(
            config=ExposureConfig(mode=mode, target=0.2), views=["front", "back"], period=0.1
        )
        self.simulator = Simulator(self.control)
        self.context = self.simulator.get_mutable_context()
        self.show(picture(100, 80, 60), picture(200, 200, 200))

    def show(self, front, back):
        for view, image in (("front", front), ("back", back)):
            port = self.control.GetInputPort(f"{view}.raw_image")
            port.FixValue(self.context, Value[ImageRgba8U](image))

    def color(self, view):
        image = self.control.GetOutputPort(f"{view}.color_image").Eval(self.context)
        return image.data[0, 0, :3].astype(int)


def test_the_gain_reaches_its_target_in_linear_light():
    raw = picture(100, 80, 60).data
    lit = exposed(raw, gain_for(raw, 0.3))
    assert gain_for(lit, 0.3) == pytest.approx(1.0, abs=0.02)
    assert (exposed(raw, 1.0) == raw).all()
    assert exposed(raw, 100.0)[0, 0, 0] == 255
    assert gain_for(picture(0, 0, 0).data, 0.3) == 10.0


def test_an_automatic_exposure_changes_a_colour_with_what_else_is_seen():
    bench = Bench("auto")
    bench.simulator.Initialize()
    assert (bench.color("front") > (100, 80, 60)).all()
    assert (bench.color("back") < 200).all()


def test_a_locked_exposure_is_the_first_front_pictures_for_all_views():
    bench = Bench("locked")
    bench.simulator.Initialize()
    first = bench.color("front")
    gain = gain_for(picture(100, 80, 60).data, 0.2)
    assert (bench.color("back") == exposed(picture(200, 200, 200).data, gain)[0, 0, :3]).all()
    bench.show(picture(20, 20, 20), picture(100, 80, 60))
    bench.simulator.AdvanceTo(1.0)
    assert (bench.color("back") == first).all()


def test_a_recalibration_locks_the_exposure_anew():
    bench = Bench("locked")
    bench.simulator.Initialize()
    before = bench.color("front")
    bench.show(picture(20, 20, 20), picture(20, 20, 20))
    bench.control.GetInputPort("recalibrations").FixValue(bench.context, [1.0])
    bench.simulator.AdvanceTo(0.2)
    assert (bench.color("front") > (20, 20, 20)).all()
    bench.show(picture(100, 80, 60), picture(100, 80, 60))
    assert (bench.color("front") > before).all()


def test_a_clone_that_is_given_to_another_simulator_keeps_the_gain():
    bench = Bench("locked")
    assert (bench.color("front") == (100, 80, 60)).all()
    bench.simulator.AdvanceTo(0.5)
    locked = bench.color("front")
    bench.context = bench.context.Clone()
    bench.show(picture(20, 20, 20), picture(20, 20, 20))
    again = Simulator(bench.control, bench.context)
    again.Initialize()
    bench.context = again.get_mutable_context()
    bench.show(picture(100, 80, 60), picture(100, 80, 60))
    assert (bench.color("front") == locked).all()
    again.AdvanceTo(1.0)
    assert (bench.color("front") == locked).all()


def test_the_station_renders_a_first_picture_only_to_lock():
    small = "robot: {image_width: 64, image_height: 48}"
    station = make_navigation_station(
        load_scenario("flat", f"{{exposure: {{mode: locked}}, {small}}}")
    )
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("base_command").FixValue(context, np.zeros(3))
    simulator.Initialize()
    locked = station.GetOutputPort("front.color_image").Eval(context).data
    plain = make_navigation_station(load_scenario("flat", small))
    raw = plain.GetOutputPort("front.color_image").Eval(plain.CreateDefaultContext()).data
    assert gain_for(locked, 0.35) == pytest.approx(1.0, abs=0.1)
    assert (locked == exposed(raw, gain_for(raw, 0.35))).all()
    assert station.HasInputPort("recalibrations")
