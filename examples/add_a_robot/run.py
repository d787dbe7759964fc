"""File 4 of 4, the integration test: an episode with the new robot, and what must hold of it."""

from tracked_cart import TrackedCart
from tracks import Tracks

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.scenario import register_robot

register_robot(TrackedCart)
scenario = load_scenario("apartment", "robot: !TrackedCart {max_speed: 0.4}")
robot = scenario.robot
tracks = Tracks(gauge=robot.gauge, top_speed=robot.top_track_speed)
result = run_episode(scenario, replace={"locomotion": tracks})
print(f"{result.robot}: {result.cause}, success: {result.success}")
assert result.success
assert result.metrics.collisions == 0
