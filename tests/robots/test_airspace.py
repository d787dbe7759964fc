"""Where an aircraft may start, and what a mirrored world makes of fence and wind."""

import pytest

from unilavira_drake import load_scenario
from unilavira_drake.errors import TaskError
from unilavira_drake.robots.flight_config import FlightConfig, WindConfig

FLIES = "robot: !Quadrotor {}\n"


@pytest.mark.parametrize("place", ["bathroom", "7.0,8.4,2.8,1.57"])
def test_an_aircraft_indoors_takes_off_from_the_ground_floor(place):
    task = f"task: {{text: Go to the sofa., start: '{place}'}}"
    load_scenario("two_storey", f"robot: !UnitreeGo1 {{can_climb: true}}\n{task}")
    with pytest.raises(TaskError, match=r"ground floor; choose .* or another robot") as caught:
        load_scenario("two_storey", FLIES + task)
    assert repr(place) in str(caught.value)
    load_scenario("two_storey", FLIES + "task: {text: Go to the sofa., start: kitchen}")


@pytest.mark.parametrize(
    ("flight", "words"),
    [
        ("{max_altitude: 20}", r"at height 25, above flight\.max_altitude \(20\)"),
        ("{geofence: [0, 0, 100, 100]}", r"at 200,300, outside flight\.geofence .*larger fence"),
    ],
)
def test_a_start_outside_the_airspace_is_refused(flight, words):
    start = "task: {text: Fly to the church., start: '200,300,25,0'}"
    load_scenario("town", start)
    with pytest.raises(TaskError, match=words):
        load_scenario("town", f"flight: {flight}\n{start}")


def test_fence_and_wind_are_mirrored_with_the_world():
    wind = WindConfig(speed=2.0, direction_degrees=30.0, gusts=1.0)
    flight = FlightConfig(geofence=[0.0, 1.0, 5.0, 9.0], wind=wind)
    assert flight.mirrored_if(False) is flight
    mirrored = flight.mirrored_if(True)
    assert mirrored.geofence == [0.0, -9.0, 5.0, -1.0]
    assert mirrored.wind == WindConfig(speed=2.0, direction_degrees=-30.0, gusts=1.0)
    assert mirrored.mirrored_if(True) == flight
    assert FlightConfig().mirrored_if(True).geofence == []


def test_a_start_in_a_mirrored_world_is_seen_within_the_mirrored_fence():
    task = "task: {text: Fly to the church., start: '200,300,25,0'}"
    for mirror in ("false", "true"):
        world = f"world: {{name: town, mirror: {mirror}}}"
        load_scenario("town", f"{world}\nflight: {{geofence: [100, 200, 300, 380]}}\n{task}")
        with pytest.raises(TaskError, match=r"outside flight\.geofence"):
            load_scenario("town", f"{world}\nflight: {{geofence: [100, 0, 300, 200]}}\n{task}")


def test_the_town_has_a_fence_around_it():
    x_min, y_min, x_max, y_max = load_scenario("town").flight.geofence
    assert x_min < 0.0 < 440.0 < x_max
    assert y_min < 0.0 < 400.0 < y_max
