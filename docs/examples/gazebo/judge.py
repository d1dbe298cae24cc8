"""Sends the goal to Nav2, logs the robot's true pose, and exits with 0 at the goal or 1 when the
simulated time is up. Untested.
"""

import math
import os
import sys
from pathlib import Path

import rclpy
from geometry_msgs.msg import PoseStamped
from nav2_simple_commander.robot_navigator import BasicNavigator
from rclpy.parameter import Parameter
from tf2_msgs.msg import TFMessage

rclpy.init()
nav = BasicNavigator()
nav.set_parameters([Parameter("use_sim_time", value=True)])
goal_x, goal_y, tolerance = map(float, os.environ["DDENV_GOAL"].split())
log, start, last = Path(sys.argv[1]).open("w"), None, None  # noqa: SIM115  (open until the program ends)


def take(message):
    global last
    for one in message.transforms:
        if one.child_frame_id == "my_robot" and start is not None:
            place, turn = one.transform.translation, one.transform.rotation
            time = nav.get_clock().now().nanoseconds * 1e-9 - start
            last = time, place.x, place.y
            print(
                time,
                place.x,
                place.y,
                place.z,
                turn.x,
                turn.y,
                turn.z,
                turn.w,
                sep=",",
                file=log,
                flush=True,
            )


nav.create_subscription(TFMessage, "/truth", take, 10)
nav.waitUntilNav2Active(localizer="robot_localization")  # or amcl, after setInitialPose
goal = PoseStamped()
goal.header.frame_id, goal.pose.position.x, goal.pose.position.y = "map", goal_x, goal_y
goal.pose.orientation.w = 1.0
start = nav.get_clock().now().nanoseconds * 1e-9
nav.goToPose(goal)
while last is None or last[0] < float(os.environ["DDENV_TIMEOUT"]):
    rclpy.spin_once(nav, timeout_sec=0.1)
    if last is not None and math.hypot(goal_x - last[1], goal_y - last[2]) <= tolerance:
        sys.exit(0)
sys.exit(1)
