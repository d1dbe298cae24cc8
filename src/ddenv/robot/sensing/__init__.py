"""What the robot measures, and its pose estimate."""
