#!/bin/bash
# One test in gz sim with Nav2. Untested: adapt the robot's file, launch file, topics and frames to yours.
source /opt/ros/jazzy/setup.bash || exit 2
# Two tests may run at the same time: each gets topics of its own.
export GZ_PARTITION="ddenv-$$" ROS_DOMAIN_ID=$((1 + $$ % 100))
name=$(sed -n 's/.*<world name="\([^"]*\)".*/\1/p' "$1" | head -1)
read -r x y z yaw <<< "$DDENV_SPAWN"
gz sim -s -r --headless-rendering --seed "$2" "$1" >&2 &
ros2 run ros_gz_bridge parameter_bridge /clock@rosgraph_msgs/msg/Clock[gz.msgs.Clock \
    "/world/$name/dynamic_pose/info@tf2_msgs/msg/TFMessage[gz.msgs.Pose_V" \
    --ros-args -r "/world/$name/dynamic_pose/info:=/truth" >&2 &
ros2 run ros_gz_sim create -world "$name" -file "$HOME/my_robot.sdf" -name my_robot -x "$x" -y "$y" -z "$z" -Y "$yaw" >&2 || exit 2
ros2 launch my_robot navigation.launch.py use_sim_time:=true >&2 &     # yours: bridge, localization, Nav2
exec python3 judge.py "$3"
