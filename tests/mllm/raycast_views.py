"""Colour, depth and label images of a world of boxes, by ray casting: no renderer needed."""

import math

import numba
import numpy as np

from unilavira_drake.messages import DIRECTIONS, VIEW_YAW, Frame, Panorama
from unilavira_drake.sensors.rig import pinhole
from unilavira_drake.worlds.palette import PALETTE

INTRINSICS = pinhole(256, 192, 79.0)
PITCH = math.radians(10.0)
CAMERA = (0.15, 0.0, 1.0)


class Caster:
    """Draws one world."""

    def __init__(self, world):
        boxes, labels, colors = [], [], []
        for box in world.walls:
            boxes.append((*box.center, *box.size, box.yaw))
            labels.append(world.label_of("walls"))
            colors.append(world.wall_color)
        for thing in world.objects:
            for box in thing.boxes:
                boxes.append((*box.center, *box.size, box.yaw))
                labels.append(world.label_of(thing.name))
                colors.append(PALETTE[thing.color])
        for room in world.rooms:
            x0, y0, x1, y1 = room.rectangle
            boxes.append(((x0 + x1) / 2, (y0 + y1) / 2, -0.05, x1 - x0, y1 - y0, 0.1, 0.0))
            labels.append(world.label_of(f"{room.name}_floor"))
            colors.append(room.floor_color)
        self._boxes = np.array(boxes)
        self._labels = np.array(labels, np.int16)
        self._colors = (np.array(colors) * 255).astype(np.uint8)

    def frame(self, view, x, y, yaw):
        X_WC = _camera_pose(x, y, yaw)
        k = INTRINSICS
        depth, index = _cast(
            self._boxes, X_WC, np.array([k.fx, k.fy, k.cx, k.cy]), k.width, k.height
        )
        hit = index >= 0
        label = np.where(hit, self._labels[index], 32766).astype(np.int16)
        color = np.where(hit[..., None], self._colors[index], 230).astype(np.uint8)
        return Frame(
            view=view, color=color, depth=depth, label=label, intrinsics=k, X_WC=X_WC, jpeg=b""
        )

    def panorama(self, n, x, y, yaw, outcome):
        frames = tuple(self.frame(view, x, y, yaw + VIEW_YAW[view]) for view in DIRECTIONS)
        c, s = math.cos(yaw), math.sin(yaw)
        X_WB = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1.0]])
        return Panorama(n=n, first=n, X_WB=X_WB, frames=frames, outcome=outcome)


def _camera_pose(x, y, yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    forward = np.array([c * math.cos(PITCH), s * math.cos(PITCH), -math.sin(PITCH)])
    right = np.array([s, -c, 0.0])
    X_WC = np.eye(4)
    X_WC[:3, :3] = np.stack((right, np.cross(forward, right), forward), axis=1)
    X_WC[:3, 3] = (x + c * CAMERA[0], y + s * CAMERA[0], CAMERA[2])
    return X_WC


@numba.njit(cache=True)
def _entry(origin, ray, size):
    """Returns where a ray enters a box about the origin, or inf."""
    near, far = 0.0, np.inf
    for p, q, side in zip(origin, ray, size):  # noqa: B905 (numba knows no strict)
        half = side / 2
        if abs(q) < 1e-12:
            if abs(p) > half:
                return np.inf
            continue
        t0, t1 = (-half - p) / q, (half - p) / q
        near, far = max(near, min(t0, t1)), min(far, max(t0, t1))
    return near if near <= far else np.inf


@numba.njit(cache=True)
def _cast(boxes, X_WC, pinhole_, width, height):
    fx, fy, cx, cy = pinhole_
    depth = np.full((height, width), np.inf, np.float32)
    index = np.full((height, width), -1, np.int32)
    origin, R = X_WC[:3, 3], X_WC[:3, :3]
    for i in range(boxes.shape[0]):
        bx, by, bz, sx, sy, sz, yaw = boxes[i]
        c, s = np.cos(yaw), np.sin(yaw)
        u0, u1, v0, v1 = width, -1, height, -1
        clipped = False
        for corner in range(8):
            lx = sx / 2 if corner & 1 else -sx / 2
            ly = sy / 2 if corner & 2 else -sy / 2
            lz = sz / 2 if corner & 4 else -sz / 2
            dx = bx + c * lx - s * ly - origin[0]
            dy = by + s * lx + c * ly - origin[1]
            dz = bz + lz - origin[2]
            z = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
            if z < 0.05:
                clipped = True
                continue
            u = fx * (R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz) / z + cx
            v = fy * (R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz) / z + cy
            u0, u1 = min(u0, int(np.floor(u))), max(u1, int(np.ceil(u)))
            v0, v1 = min(v0, int(np.floor(v))), max(v1, int(np.ceil(v)))
        if u1 < 0 and v1 < 0:
            continue
        if clipped:
            u0, u1, v0, v1 = 0, width - 1, 0, height - 1
        ox, oy, oz = origin[0] - bx, origin[1] - by, origin[2] - bz
        px, py = c * ox + s * oy, -s * ox + c * oy
        for v in range(max(v0, 0), min(v1, height - 1) + 1):
            y = (v - cy) / fy
            for u in range(max(u0, 0), min(u1, width - 1) + 1):
                x = (u - cx) / fx
                wx = R[0, 0] * x + R[0, 1] * y + R[0, 2]
                wy = R[1, 0] * x + R[1, 1] * y + R[1, 2]
                wz = R[2, 0] * x + R[2, 1] * y + R[2, 2]
                qx, qy = c * wx + s * wy, -s * wx + c * wy
                near = _entry((px, py, oz), (qx, qy, wz), (sx, sy, sz))
                if 0.1 < near <= 10.0 and near < depth[v, u]:
                    depth[v, u] = near
                    index[v, u] = i
    return depth, index
