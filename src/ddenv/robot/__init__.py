"""One run of the robot in a sub-environment: simulated on Drake or by a command, and whether it shows the failure."""
