"""The simulator of drive.py as a class, which also says which models took part: those that the
robot touched.
"""

import math
import random

from drive import NOISE, SPEED, STEP, obstacles, pushed_out

import ddenv


class Corner:
    def __init__(self, setup):
        self.spawn, self.goal = setup.scenario["robot"]["spawn"], setup.scenario["goal"]

    def run(self, world, seed, timeout):
        x, y, z, yaw = (self.spawn[key] for key in ("x", "y", "z", "yaw"))
        noise, touched = random.Random(seed), set()
        there = [(name, one) for name in world.models for one in obstacles(world.path, name)]
        for step in range(round(timeout / STEP) + 1):
            yield step * STEP, (x, y, z, 0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
            if math.hypot(self.goal["x"] - x, self.goal["y"] - y) <= self.goal["tolerance"]:
                return ddenv.Ended(True, took_part=touched)
            yaw = math.atan2(self.goal["y"] - y, self.goal["x"] - x) + noise.gauss(0, NOISE)
            x, y = x + SPEED * STEP * math.cos(yaw), y + SPEED * STEP * math.sin(yaw)
            for name, obstacle in there * 2:
                before, (x, y) = (x, y), pushed_out(x, y, obstacle)
                if (x, y) != before:
                    touched.add(name)
        return ddenv.Ended(False, took_part=touched)
