"""The world and the robot in Drake."""
