#!/usr/bin/env python3
"""A simulator in sixty lines: a round robot, seen from above, heads for its goal and slides along
what is in its way.

drive.py WORLD SEED; the rest is in environment variables. Prints the pose log. Exit codes: 0 goal
reached, 1 time is up.
"""

import math
import os
import random
import sys
import xml.etree.ElementTree as ET

RADIUS, SPEED, STEP = 0.3, 0.8, 0.05  # m, m/s, s
NOISE = 0.1  # of the heading, rad


def obstacles(file, name=None):
    """x, y, yaw, half length, half width and radius of each collision, or of those of the model
    `name`.
    """
    found = []
    for model in ET.parse(file).getroot().iter("model"):
        if name not in (None, model.get("name")):
            continue
        x, y, _, _, _, yaw = map(float, (model.findtext("pose") or "0 0 0 0 0 0").split())
        for shape in model.iterfind("link/collision/geometry/*"):
            if shape.tag == "box":
                length, width, _ = map(float, shape.findtext("size").split())
                found.append((x, y, yaw, length / 2, width / 2, 0.0))
            elif shape.tag == "cylinder":
                found.append((x, y, yaw, 0.0, 0.0, float(shape.findtext("radius"))))
    return found


def pushed_out(x, y, obstacle):
    """Where a robot at x, y is once it does not overlap the obstacle any more."""
    ox, oy, yaw, half_length, half_width, radius = obstacle
    c, s = math.cos(yaw), math.sin(yaw)
    u, v = c * (x - ox) + s * (y - oy), c * (y - oy) - s * (x - ox)
    near_u, near_v = max(-half_length, min(u, half_length)), max(-half_width, min(v, half_width))
    gap = math.hypot(u - near_u, v - near_v)
    if gap >= RADIUS + radius or gap == 0:
        return x, y
    scale = (RADIUS + radius) / gap
    u, v = near_u + scale * (u - near_u), near_v + scale * (v - near_v)
    return ox + c * u - s * v, oy + s * u + c * v


def main():
    world, seed = sys.argv[1:]
    x, y, z, yaw = map(float, os.environ["DDENV_SPAWN"].split())
    goal_x, goal_y, tolerance = map(float, os.environ["DDENV_GOAL"].split())
    noise, there = random.Random(int(seed)), obstacles(world)
    print("t,x,y,z,qx,qy,qz,qw")
    for step in range(round(float(os.environ["DDENV_TIMEOUT"]) / STEP) + 1):
        turn = f"{math.sin(yaw / 2):.6f},{math.cos(yaw / 2):.6f}"
        print(f"{step * STEP:.2f},{x:.4f},{y:.4f},{z:.4f},0,0,{turn}")
        if math.hypot(goal_x - x, goal_y - y) <= tolerance:
            return 0
        yaw = math.atan2(goal_y - y, goal_x - x) + noise.gauss(0, NOISE)
        x, y = x + SPEED * STEP * math.cos(yaw), y + SPEED * STEP * math.sin(yaw)
        for obstacle in there * 2:
            x, y = pushed_out(x, y, obstacle)
    return 1


if __name__ == "__main__":
    sys.exit(main())
