"""What a viewer may ask of the engine: the kinds of the run file's `command` table, with their data.

Models are numbers into the run's `elements`.

pause
resume
step          unit: "test" or "round"; runs that much, then pauses
accept        round, candidate: take the waiting reduction
reject        round, candidate: go on as if it had not shown the failure
accept_mode   mode: "automatic" or "ask"
veto          round, candidate: leave out a candidate that is not judged yet
unveto        round, candidate: try a vetoed or rejected one after all
pin           models: they stay, and are in no partition
unpin         models
try           models: those that are kept; a sub-environment of the user's own making is tested
adopt         trial: one that was similar becomes the environment
accept_other  test: its failure counts as f from here on, and where it showed becomes the environment
undo          takes back the last reduction, with what was accepted by it; the same is not made again
go_back       node: its environment is the current one again, and the run pauses
change        settings: some of pair, algorithm, iterations, budget, as in the scenario's section `reduction`
stop          ends the engine; `ddenv resume` goes on from there
"""

KINDS = (
    "pause",
    "resume",
    "step",
    "accept",
    "reject",
    "accept_mode",
    "veto",
    "unveto",
    "pin",
    "unpin",
    "try",
    "adopt",
    "accept_other",
    "undo",
    "go_back",
    "change",
    "stop",
)
