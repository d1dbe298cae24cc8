"""The controllers that come with ddenv: from what the robot measures to how it drives."""
