"""The numbers of runs: each purpose has a block of its own.

Run i of a scenario has the seed i + the scenario's own, so runs of two blocks never have the same
luck: what judges a result repeats no run that chose it.
"""

from __future__ import annotations

from itertools import pairwise

# The baseline, the rounds and what a user tries.
SEARCH = range(10_000)
# Fresh runs. Each certificate has a part of its own: so many, or more if it is asked for more.
CERTIFICATES = range(SEARCH.stop, 100_000_000)
OF_CERTIFICATE = 1000
# Fresh runs of a nearest world that passes.
ISOLATIONS = range(CERTIFICATES.stop, 500_000_000)
# Fresh runs of worlds in which a number is changed so that the robot passes.
FIXES = range(ISOLATIONS.stop, 1_000_000_000)
# Runs of what is left in another simulator.
OTHER_SIMULATORS = range(FIXES.stop, 2**31)

# A test of `ddenv.reduce` has no seed. Its calls only have to be told apart.
CALLS_OF_CERTIFICATE = 1_000_000

_BLOCKS = (SEARCH, CERTIFICATES, ISOLATIONS, FIXES, OTHER_SIMULATORS)
assert all(before.stop <= after.start for before, after in pairwise(_BLOCKS))
