"""A walking robot takes the stairs: one map for each floor, and its height on the way."""

import matplotlib.pyplot as plt
import numpy as np

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import LanguageAction, NavigationStatus, OccupancyMap, Panorama
from unilavira_drake.recording.map_layers import draw_occupancy
from unilavira_drake.worlds.load import load_world

TASK = "Go upstairs and stop next to the red bean bag in the children's room."


class Log:
    """What the ring said: places, stairs, and the latest map of each floor."""

    def __init__(self) -> None:
        self.places, self.maps, self.floor = [], {}, 0.0

    def __call__(self, t, system, event, message) -> None:
        if isinstance(message, Panorama):
            self.floor = round(message.position[2], 1)
            self.places.append((t, *message.position))
        elif isinstance(message, OccupancyMap):
            self.maps[self.floor] = message
        elif isinstance(message, LanguageAction) and message.tool == "go_stair":
            print(f"{t:5.1f} s  {message.reasoning_action}")
        elif isinstance(message, NavigationStatus) and "floor" in message.reason:
            print(f"{t:5.1f} s  {message.state}: {message.reason}")


if __name__ == "__main__":
    scenario = load_scenario("two_storey", f'task: {{text: "{TASK}", goal: bean_bag_1}}')
    log, house = Log(), load_world("two_storey")
    result = run_episode(scenario, on_event=log)
    places = np.array(log.places)
    figure, axes = plt.subplots(1, 3, figsize=(15, 4.4), layout="tight", subplot_kw={"fc": "0.9"})
    for one, (floor, seen) in zip(axes, sorted(log.maps.items()), strict=False):
        draw_occupancy(one, seen)
        here = places[np.abs(places[:, 3] - floor) < 0.5]
        one.plot(here[:, 1], here[:, 2], "o-", color="black", mec="white", zorder=4)
        one.set(xlim=(0, 12.6), ylim=(0, 9.4), aspect="equal", title=f"floor at {floor:.1f} m")
    stairs = house.stairs[0]
    s, z = np.transpose((*stairs.profile, (stairs.length, stairs.top)))
    axes[2].stairs(
        [tread[2] for tread in stairs.treads()],
        [0.0, *(tread[1] for tread in stairs.treads())],
        fill=True,
        color="0.8",
    )
    axes[2].plot(s, z, color="black")
    axes[2].set(aspect="equal", title="the way over the steps, m")
    figure.savefig("two_storey_map.png", dpi=120)
    print(f"{result.cause}; success: {result.success}; {result.metrics.path_length_m:.1f} m")
    print("see two_storey_map.png")
