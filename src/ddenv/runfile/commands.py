"""What a viewer may ask of the engine: the kinds of the run file's `command` table, with their data.

pause
resume
step          unit: "test" or "round"; runs that much, then pauses
accept        round, candidate: take the waiting reduction
reject        round, candidate: go on as if it had not shown the failure
accept_mode   mode: "automatic" or "ask"
veto          round, candidate: leave out a candidate that is not judged yet
stop          ends the engine; `ddenv resume` goes on from there
"""

KINDS = ("pause", "resume", "step", "accept", "reject", "accept_mode", "veto", "stop")
