"""Runs at moments that tests look at: what a fake engine has written until then."""

from __future__ import annotations

from array import array

from ddenv.evidence.claims import is_minimal
from ddenv.runfile.store import ROBOT
from ddenv.words.claims import verdict_on
from tests.workbench.fake_run import FakeRun, path_samples


def mid_round(run: FakeRun) -> FakeRun:
    """Round 2 with one part judged and a re-run under way."""
    run.created().baseline()
    run.start_round(2)
    test = run.similar(0)
    left = run.elements[:6]
    run.reduce(0, left, test)
    run.start_round(3, left)
    run.dissimilar(0)
    run.test(1, "pass")
    first = run.start(1, 1)
    second = run.start(2, 0)
    run.live((first, 0.6), (second, 0.25))
    return run


def sliced(run: FakeRun) -> FakeRun:
    """In the first round of a slice the test of the third candidate is implied by that of the
    second; the next one runs.
    """
    run.created().write("still")
    run.met = [f"crate_{number:02}" for number in (2, 3, 4, 6, 7)]
    run.baseline()
    run.write(
        "sliced", environment=run.numbers(run.met), tests=[1, 2, 3, 4], evidence_test=1, audit=False
    )
    run.write("leg_started", round=1, n_partitions=None)
    run.start_round(3, run.met)
    run.dissimilar(0)
    without = run.test(1, "pass")
    run.judge(1, "dissimilar", [without])
    run.judge(2, "dissimilar", [run.imply(2, without)])
    run.live((run.start(3), 0.5))
    return run


def piled(run: FakeRun) -> FakeRun:
    """A round in a world where crates lie on others, with one part judged."""
    run.created().supports(
        ("crate_02", "crate_05"), ("crate_01", "crate_02"), ("crate_07", "crate_04")
    )
    run.baseline()
    run.start_round(3)
    run.dissimilar(0)
    run.live((run.start(1, 0), 0.6))
    return run


def waiting(run: FakeRun) -> FakeRun:
    """Round 1: the first part shows f, and waits for the user."""
    run.created().baseline()
    run.write("accept_mode_changed", mode="ask")
    run.start_round(3)
    run.similar(0)
    run.write("waiting", candidate=0)
    return run


def _rounds(run: FakeRun) -> FakeRun:
    """A run whose rounds left two models."""
    run.created().baseline()
    left = run.elements
    for keep, parts in ((6, 2), (2, 3)):
        run.start_round(parts, left)
        test = run.similar(0)
        left = left[:keep]
        run.reduce(0, left, test)
    run.start_round(2, left)
    run.dissimilar(0)
    run.dissimilar(1)
    run.write("round_finished")
    return run


def guided(run: FakeRun) -> FakeRun:
    """Two reductions, one taken back; a pinned model; three selections by hand: one adopted, one in
    vain, one under way.
    """
    run.created().baseline()
    run.start_round(2)
    left = run.elements[:6]
    run.reduce(0, left, run.similar(0))
    run.start_round(3, left)
    run.reduce(1, left[:2] + left[4:], run.similar(1))
    run.go_back(1, rejected=2)
    run.pin(left[0])
    kept = left[:5]
    adopted = run.try_out(kept)
    test = run.start_hand(adopted)
    run.finish(test, "similar", 0.12, failure="stuck")
    run.judge_trial(adopted, "similar", [test])
    run.adopt(adopted, kept, test)
    vain = run.try_out(kept[:2])
    tests = [run.start_hand(vain, number) for number in range(4)]
    for number in tests:
        run.finish(number, "other", 2.3, failure="tipped over")
    run.judge_trial(vain, "dissimilar", tests)
    run.start_round(2, kept, pinned=(left[0],))
    run.dissimilar(0)
    under_way = run.try_out(kept[1:])
    run.live((run.start(1, 0), 0.4), (run.start_hand(under_way), 0.7))
    return run


def certifying(run: FakeRun) -> FakeRun:
    """The rounds left two models, and fresh runs show what they are worth."""
    _rounds(run).start_certificate()
    run.certify_all(2, None, "sssssspsssss")
    run.certify_all(0, None, "......s")
    run.certify_all(2, "crate_00", "oppe")
    run.live((run.certify(2, "crate_00", 4), 0.6), (run.certify(2, "crate_01"), 0.25))
    return run


def finished(run: FakeRun) -> FakeRun:
    """A run that ended with two models, each shown to be needed."""
    _rounds(run).start_certificate()
    claims = (
        (None, "kept", 23 * "s"),
        ("crate_00", "needed", 9 * "p" + "oo"),
        ("crate_01", "needed", 11 * "p" + "s"),
    )
    run.certify_all(0, None, 11 * "s" + "p" + 11 * "s")
    return _claimed(run, claims)


def faster_without(run: FakeRun) -> FakeRun:
    """A finished run in which the robot is faster without crate_00."""
    finished(run)
    samples = path_samples()[: 8 * 60]
    samples[1::8] = array("d", [1.2 * x + 1.2 for x in samples[1::8]])
    run.put_motion(61, samples)
    return run


def isolating(run: FakeRun) -> FakeRun:
    """After its end, isolation: the robot passes without the two models that were left; without one
    of them it is being tried.
    """
    finished(run).start_isolation(2)
    both = run.remove("crate_00", "crate_01")
    run.write(
        "removal_judged", removal=both, verdict="passes", tests=run.isolate_all(both, "ppppp")
    )
    run.live((run.isolate(run.remove("crate_00"), 0), 0.5))
    return run


def isolated(run: FakeRun) -> FakeRun:
    """Isolation has ended: the robot passes without one model."""
    finished(run).start_isolation(2)
    both, one = run.remove("crate_00", "crate_01"), run.remove("crate_00")
    run.write(
        "removal_judged", removal=both, verdict="passes", tests=run.isolate_all(both, "ppppp")
    )
    run.write("removal_judged", removal=one, verdict="passes", tests=run.isolate_all(one, "ppppp"))
    whole = run.remove()
    tests = [*run.isolate_all(one, 20 * "p", 100_000), *run.isolate_all(whole, 9 * "s", 100_000)]
    claims = (
        {"back": None, "verdict": "passes", "reached": 20, "runs": 20, "low": 0.84, "high": 1.0},
        {"back": 0, "verdict": "needed", "reached": 0, "runs": 9, "low": 0.0, "high": 0.3},
    )
    run.write("isolation_checked", removal=one, claims=claims, tests=tests)
    run.write("isolation_finished", removal=one)
    return run


def with_margins(run: FakeRun) -> FakeRun:
    """Margins of two numbers are known, and a fix that fresh runs confirm."""
    finished(run)
    numbers = (
        {
            "name": "crate_00.friction",
            "now": 0.1,
            "low": 0.0,
            "high": 1.0,
            "scale": 0.9,
            "resolution": 0.01,
        },
        {
            "name": "crate_01.y",
            "now": 0.5,
            "low": -2.5,
            "high": 3.5,
            "scale": 3.0,
            "resolution": 0.01,
            "unit": "m",
        },
    )
    began = {
        "environment": run.state.nodes[run.state.node].id,
        "rate": 0.95,
        "error": 0.004,
        "budget": 100,
    }
    run.write(
        "margins_started",
        numbers=numbers,
        certified=True,
        status="finished",
        before=run.state.reason,
        **began,
    )
    tried = (
        ("crate_00.friction", 0.0, "sssss"),
        ("crate_00.friction", 0.2, "sssss"),
        ("crate_00.friction", 0.4, "ppppppp"),
        ("crate_01.y", 0.31, "ooooooo"),
        ("crate_01.y", 0.69, "sssss"),
    )
    for name, value, outcomes in tried:
        for number, letter in enumerate(outcomes):
            margin_ran(run, name, value, number, letter)
    run.write(
        "margin_impossible",
        name="crate_01.y",
        value=1.25,
        why="crate_01 would be 0.20 m inside crate_00",
    )
    for number in range(20):
        margin_ran(run, "crate_00.friction", 0.4, 500_000_000 + number, "p")
    run.write("margins_finished")
    return run


def margin_ran(run: FakeRun, name: str, value: float, number: int, letter: str) -> None:
    """A run with another value ends as this letter says: f, the goal, or lost."""
    outcome, failure = {"s": ("similar", "stuck"), "p": ("pass", ""), "o": ("other", "lost")}[
        letter
    ]
    ended = {
        "outcome": outcome,
        "failure": failure,
        "distance": None,
        "end_pose": None,
        "wall_seconds": 2.0,
    }
    motions = {ROBOT: path_samples().tobytes()}
    run.write("margin_ran", motions, name=name, value=value, run=number, seed=number, **ended)


def uncertified(run: FakeRun) -> FakeRun:
    """A run that ended with two models and without a certificate."""
    _rounds(run).write("finished", minimal=True, reason="no single model can be removed")
    return run


def not_shown(run: FakeRun) -> FakeRun:
    """A run that ended with two models, one of which may not be needed."""
    _rounds(run).start_certificate()
    claims = (
        (None, "kept", 23 * "s"),
        ("crate_00", "not shown", 9 * "sp" + "oo"),
        ("crate_01", "unknown", "pseeeeee"),
    )
    run.certify_all(0, None, 11 * "s" + "p" + 11 * "s")
    return _claimed(run, claims)


def helped(run: FakeRun) -> FakeRun:
    """A run that ended with two models, one of which only helps."""
    _rounds(run).start_certificate()
    claims = (
        (None, "kept", 60 * "s"),
        ("crate_00", "needed", 11 * "p"),
        ("crate_01", "helps", 12 * "ssssp"),
    )
    return _claimed(run, claims)


def rarer(run: FakeRun) -> FakeRun:
    """Round 2 in an environment that showed f in one of six runs."""
    run.created().baseline()
    run.start_round(2)
    left, endings = run.elements[:6], ("pass", "similar", "pass", "other", "pass", "pass")
    tests = [run.test(0, outcome, 0.12, number) for number, outcome in enumerate(endings)]
    run.judge(0, "similar", tests)
    run.reduce(0, left, tests[1])
    run.start_round(3, left)
    run.dissimilar(0)
    run.live((run.start(1), 0.6))
    return run


def _claimed(run: FakeRun, claims: tuple) -> FakeRun:
    """The runs of the current environment that each claim rests on, and the end."""
    for without, _, outcomes in claims:
        run.certify_all(2, without, outcomes)
    run.finish_certificate(*claims)
    certificate = run.state.certificates[-1]
    run.write("finished", minimal=is_minimal(certificate), reason=verdict_on(certificate))
    return run
