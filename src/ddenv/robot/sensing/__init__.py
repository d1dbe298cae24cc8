"""What the robot measures, and where it believes it is."""
