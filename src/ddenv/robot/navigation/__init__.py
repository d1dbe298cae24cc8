"""How the robot finds its way: from what it measures to how it wants to move."""
