"""Mapping without an agent: ``OccupancyMapper`` in one's own Diagram, from frontier to frontier."""

import numpy as np
from matplotlib.pyplot import subplots
from pydrake.common.value import AbstractValue
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from unilavira_drake import load_scenario
from unilavira_drake.mapping.frontiers import find_frontiers
from unilavira_drake.mapping.system import OccupancyMapper
from unilavira_drake.messages import Panorama
from unilavira_drake.planning.fast_marching import distance_field
from unilavira_drake.planning.navigation_grid import make_navigation_grid
from unilavira_drake.planning.polyline import extract_path, length
from unilavira_drake.recording.map_layers import draw_occupancy
from unilavira_drake.sensors.rig import front_intrinsics
from unilavira_drake.station import make_navigation_station

if __name__ == "__main__":
    scenario, builder = load_scenario("apartment"), DiagramBuilder()
    robot, place, stops, looks = scenario.robot, (2.9, 8.2), [], []
    station = builder.AddSystem(make_navigation_station(scenario))
    mapper = builder.AddSystem(OccupancyMapper(intrinsics=front_intrinsics(robot), stride=3))
    for port in ("front.depth_image", "front.X_BC", "pose_estimate"):
        builder.Connect(station.GetOutputPort(port), mapper.GetInputPort(port))
    simulator = Simulator(builder.Build())
    root, plant = simulator.get_mutable_context(), station.GetSubsystemByName("plant")
    at, there, inside = (s.GetMyMutableContextFromRoot(root) for s in (mapper, station, plant))
    mapper.GetInputPort("panorama").FixValue(at, AbstractValue.Make(Panorama()))
    station.GetInputPort("base_command").FixValue(there, np.zeros(3))
    while place is not None and len(stops) < 25:
        stops.append(place)  # The robot is put there; it can get there over known free floor.
        for yaw in np.radians(np.arange(0.0, 360.0, 30.0)):
            plant.SetPositions(inside, plant.GetModelInstanceByName(robot.name), [*place, yaw])
            simulator.AdvanceTo(root.get_time() + 0.1)
        seen = mapper.GetOutputPort("map").Eval(at)
        ends = {f.goal: f for f in find_frontiers(seen, position=place, radius=0.4) if f.goal}
        looks.append((seen, ends))
        gain = [(f.size / (2.0 + np.hypot(*np.subtract(p, place))), p) for p, f in ends.items()]
        place = max(gain, default=(0.0, None))[1]
    size = {"radius": robot.radius, "turning_radius": robot.turning_radius}
    grid, goal = make_navigation_grid(seen, position=stops[0], targets=(), **size), (17.4, 1.2)
    times = distance_field(grid.blocked, np.array([grid.cell(*goal)]), slowness=grid.slowness)
    way = extract_path(times, grid.blocked, grid.slowness, grid.point(*stops[0]))
    way = way * grid.resolution + grid.origin
    figure, axes = subplots(1, 2, figsize=(14, 5), layout="constrained", subplot_kw={"fc": "0.9"})
    for one, count in zip(axes, (3, len(stops)), strict=True):
        draw_occupancy(one, looks[count - 1][0])
        one.set(xlim=(-0.2, 18.6), ylim=(-0.2, 11.6), aspect="equal", xlabel="x, m", ylabel="y, m")
        one.plot(*np.transpose(stops[:count]), "ko", mec="w", zorder=4, label=f"{count} looks")
    for frontier in looks[2][1].values():
        axes[0].plot(*frontier.p_WF.T, "s", ms=2.5, label=f"frontier of {frontier.size:.1f} m")
    field = np.ma.masked_where(grid.blocked | (grid.log_odds >= 0), times * grid.resolution)
    x, y = (grid.origin[k] + grid.resolution * np.arange(times.shape[1 - k] + 1) for k in (0, 1))
    axes[1].plot(*way.T, "w*-", mfc="r", ms=17, markevery=[-1], zorder=3, label="way to the goal")
    figure.colorbar(axes[1].pcolormesh(x, y, field, zorder=2), label="weighted way to the goal, m")
    axes[0].legend(loc="right"), axes[1].legend(loc=(0.2, -0.23), ncols=2, facecolor="0.6")
    figure.savefig("apartment_map.png", dpi=120)
    print(f"{len(stops)} looks around; a way of {length(way):.1f} m; see apartment_map.png")
