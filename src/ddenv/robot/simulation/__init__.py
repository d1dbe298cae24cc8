"""One run on Drake: the plant of a scenario, what happens in a run, what the robot notices, and who
took part.
"""
