"""What a reduction is said to cost, and where the seconds come from."""

import fake_run

from ddenv.workbench.setup.start_run import Past, past_of, whole_cost
from ddenv.world.scenario import Scenario


def scenario(**reduction):
    data = fake_run.scenario()
    data["reduction"] |= reduction
    return Scenario.model_validate(data)


def test_seconds_come_from_earlier_runs_of_the_same_scenario(runs):
    assert past_of(scenario(), runs) == Past()
    fake_run.FakeRun(runs / "a.ddenv").created().baseline().close()
    other = fake_run.scenario(name="other")
    fake_run.FakeRun(runs / "b.ddenv", other).created().baseline(4).close()
    (runs / "bad.ddenv").write_text("no run")
    assert past_of(scenario(), runs) == Past(2.0, 0.75)
    assert past_of(scenario(), runs / "none") == Past()


def test_tests_and_time_are_told():
    known = Past(3.0, 0.9)
    words = whole_cost(scenario(), 43, 2, known)
    assert words.startswith("about ")
    assert (
        "tests (35 to 250): 4 for the baseline, 35 for the search, 50 for the certificate; "
        in words
    )
    assert words.endswith("with 2 jobs at 3.0 s a test, as before")
    unknown = whole_cost(scenario(), 43, 2, Past())
    parts = "4 for the baseline, 35 for the search, 50 for the certificate"
    assert unknown == f"about 90 tests (35 to 200): {parts}; more if the failure is rare"
    assert whole_cost(scenario(budget=9), 43, 1, known) == (
        "9 tests at most: 4 for the baseline, then the search; 25 s with 1 job at 3.0 s a test, "
        "as before"
    )
