"""Mapping and planning in 3-D without an agent: an aircraft finds its way past walls it sees.

``VoxelMapper`` and ``VisibilityPlanner`` alone; camera and aircraft are a few lines of numpy.
"""

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import ImageDepth32F

from unilavira_drake.mapping.voxel_system import VoxelMapper
from unilavira_drake.messages import Goal, Intrinsics, NavigationStatus, Panorama
from unilavira_drake.planning.visibility_path import remaining_way
from unilavira_drake.planning.visibility_system import VisibilityPlanner

LENS = Intrinsics(80, 60, 40.0, 40.0, 39.5, 29.5)
R_WC = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # Always looks along x.
BOXES = np.array([[-9, -30, -1, 60, 30, 0], [10, -9, 0, 11, 6, 9], [20, -4, 0, 21, 20, 7.0]])
GOAL = (30.0, 2.0, 3.0)


def depth_of(p_WC):
    """The exact depth image of the boxes."""
    v, u = np.mgrid[: LENS.height, : LENS.width]
    rays = np.stack([(u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, u**0.0], -1) @ R_WC.T
    a, b = ((BOXES[:, None, None, k : k + 3] - p_WC) / (rays + 1e-12) for k in (0, 3))
    enter, leave = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
    return np.where((enter < leave) & (enter > 0), enter, np.inf).min(axis=0)


if __name__ == "__main__":
    builder = DiagramBuilder()
    mapper = builder.AddSystem(VoxelMapper(intrinsics={"front": LENS}, stride=1))
    planner = builder.AddSystem(VisibilityPlanner())
    builder.Connect(mapper.get_output_port(), planner.GetInputPort("voxel_map"))
    for port in ("pose_estimate", "front.depth_image"):
        builder.ExportInput(mapper.GetInputPort(port), port)
    builder.ConnectInput("pose_estimate", planner.GetInputPort("pose_estimate"))
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    at, to = (system.GetMyMutableContextFromRoot(root) for system in (mapper, planner))
    X_BC = Value[RigidTransform](RigidTransform(RotationMatrix(R_WC), [0, 0, 0]))
    mapper.GetInputPort("front.X_BC").FixValue(at, X_BC)
    mapper.GetInputPort("panorama").FixValue(at, AbstractValue.Make(Panorama(n=1)))
    planner.GetInputPort("goal").FixValue(to, AbstractValue.Make(Goal(1, "go", p_WG=GOAL)))
    p_WB, nearest, status = np.array([0.0, 0, 3]), 9.0, NavigationStatus()
    while status.n == 0 or not status.terminal:
        (image := ImageDepth32F(80, 60)).mutable_data[:, :, 0] = depth_of(p_WB)
        for name, value in (("pose_estimate", RigidTransform(p_WB)), ("front.depth_image", image)):
            simulator.get_system().GetInputPort(name).FixValue(root, Value[type(value)](value))
        simulator.AdvanceTo(root.get_time() + 0.1)
        status = planner.GetOutputPort("navigation_status").Eval(to)
        if len(path := planner.GetOutputPort("path").Eval(to).p_WP):
            step = path[remaining_way(path, tuple(p_WB))[1]] - p_WB
            p_WB = p_WB + step * min(1.0, 0.3 / max(np.linalg.norm(step), 1e-9))
        gaps = np.maximum(np.maximum(BOXES[:, :3] - p_WB, p_WB - BOXES[:, 3:]), 0.0)
        nearest = min(nearest, np.linalg.norm(gaps, axis=1).min())
    print(f"{status.state} after {root.get_time():.1f} s; never nearer than {nearest:.2f} m")
