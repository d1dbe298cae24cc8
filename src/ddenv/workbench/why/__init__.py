"""Why the robot fails: what happens without each model that is left."""
