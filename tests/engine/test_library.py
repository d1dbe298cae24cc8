"""`ddenv.reduce` and the engine make the same decisions on the same oracle and terms: both drive
the one procedure.
"""

import tempfile
from collections import Counter
from functools import partial
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import given
from hypothesis import strategies as st

import ddenv
from ddenv.engine.judging import traits_of, trajectory_of
from ddenv.errors import UserError
from ddenv.evidence.certificate import Terms
from ddenv.run_numbers import CALLS_OF_CERTIFICATE
from ddenv.schemas import names
from ddenv.world.extent import center
from ddenv.world.sdf.read import read_world
from tests.conftest import DATA
from tests.engine.fake import ELEMENTS, SENSED, TOUCHED, FakePool, drive, new_run, result
from tests.tiers import examples

WORLD = {model.name: model for model in read_world(DATA / "wall.sdf").models}
KNOWN = {
    "positions": {name: center(WORLD[name]) for name in ELEMENTS},
    "traits": {name: traits_of(WORLD[name]) for name in ELEMENTS},
    "trajectory": trajectory_of(result("failed", 0, 2.0).trajectory),
    "failure_pose": (2.0, 0.0, 0.0),
    "first_sensed": {name: at for name, at in SENSED.items() if name in ELEMENTS},
    "touched": [name for name in TOUCHED if name in ELEMENTS],
}
# The learner also uses how likely f is missed, which only the engine knows.
PAIRS = ["model2model/failure-proximal", "timeseg/timestep", "trajectoryseg/sequential"]


class Oracle:
    """Shows f in `tenths` of the runs that have the needed models, and now and then in others;
    notes which models it ran.
    """

    def __init__(self, salt, needed, tenths):
        self.salt, self.needed, self.tenths = salt, needed, tenths
        self.made, self.runs = [], Counter()

    def shows(self, models):
        self.made.append(models)
        self.runs[models] += 1
        luck = crc32(f"{self.salt} {sorted(models)} {self.runs[models]}".encode()) % 40
        return luck < (4 * self.tenths if models >= self.needed else 1)


@given(
    salt=st.integers(0, 10**6),
    needed=st.sets(st.sampled_from(ELEMENTS), min_size=1, max_size=3),
    tenths=st.sampled_from([10, 9, 6]),
    algorithm=st.sampled_from(names("algorithm")),
    pair=st.sampled_from(PAIRS),
    accept=st.sampled_from(["kept", "first"]),
    growth=st.sampled_from(["paper", "steady"]),
)
@examples(0.5)
def test_the_library_and_the_engine_test_the_same_models_in_the_same_order(
    salt, needed, tenths, algorithm, pair, accept, growth
):
    ours, theirs = (Oracle(salt, needed, tenths) for _ in range(2))
    more = {
        "iterations": 3,
        "keep_rate": 0.8,
        "baseline_runs": 10,
        "growth": growth,
        "skip": "implied",
    }
    partitioning, prioritization = pair.split("/")
    try:
        found = ddenv.reduce(
            ELEMENTS,
            ours.shows,
            algorithm=algorithm,
            partitioning=partitioning,
            prioritization=prioritization,
            accept_rate=accept,
            **more,
            **KNOWN,
        )
    except UserError:
        found = None
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        # Without seeds runs are made in blocks, and claims may begin anew with later numbers.
        patch.setattr("ddenv.evidence.claims.Terms", partial(Terms, order_seed=0))
        patch.setattr("ddenv.engine.journal.OF_CERTIFICATE", CALLS_OF_CERTIFICATE)
        path = new_run(
            Path(folder), algorithm=algorithm, pair=pair, accept_rate=accept, slice=False, **more
        )
        pool = FakePool(lambda keep, _: "similar" if theirs.shows(keep) else "pass", 1)
        state = drive(path, pool)
    if found is None:
        assert "reached its goal in all" in state.reason
        return
    # The rule of the paper ends the library's search; the engine makes a certificate, too.
    length = len(ours.made)
    assert theirs.made[:length] == ours.made
    assert state.environment == found.kept
    if accept == "kept":
        assert len(theirs.made) == length
        assert state.minimal == found.minimal
        claims = [
            (claim.without, claim.verdict, claim.shown, claim.runs)
            for claim in state.certificate.claims
        ]
        assert claims == [
            (claim.without, claim.verdict, claim.shown, claim.runs) for claim in found.claims
        ]
