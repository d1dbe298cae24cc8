"""The procedure makes the same of a world whoever drives it, and keeps what it promises."""

from copy import deepcopy
from itertools import count, takewhile

from hypothesis import given
from hypothesis import strategies as st

from ddenv.environment import Environment
from ddenv.evidence.certificate import good_enough, settle
from ddenv.evidence.rates import estimated_rate
from ddenv.reduction.procedure import Changed, Search, judge, last_good, procedure
from ddenv.reduction.verdict import Acceptance
from tests.reduction.driving import Driver, Killed, Known, World
from tests.reduction.worlds import ALGORITHMS
from tests.tiers import examples

some_models = st.sets(st.integers(0, 4), max_size=2).map(Environment.of)
worlds = st.builds(
    World,
    labels=st.lists(st.integers(0, 4), min_size=1, max_size=5).map(tuple),
    needed=some_models,
    useful=some_models,
    algorithm=st.sampled_from(ALGORITHMS),
    seed=st.integers(0, 10**6),
    rate=st.sampled_from([1.0, 0.95, 0.85]),
    factor=st.sampled_from([0.2, 0.4]),
    breaks=st.sampled_from([0.0, 0.0, 0.02]),
    iterations=st.integers(0, 3),
    keeps_rate=st.booleans(),
    pinned=st.sampled_from([None, None, 0]),
    competes=st.booleans(),
)


def begun(driver, search=None):
    world = driver.world
    return procedure(driver, world.whole, world.baseline_runs, world.keeps_rate, search)


def driven(world, **options):
    """A driver that has come to the end, and that."""
    driver = Driver(world, **options)
    return driver, driver.drive(begun(driver))


@given(world=worlds, workers=st.integers(2, 9), order=st.integers(0, 10**6))
def test_whatever_ends_first_and_however_many_run_all_that_is_found_is_the_same(
    world, workers, order
):
    alone, end = driven(world)
    together, same = driven(world, workers=workers, order=order)
    assert together.facts == alone.facts
    assert same == end


@given(world=worlds)
def test_a_single_worker_makes_no_test_that_nothing_rests_on(world):
    driver, _ = driven(world)
    assert {(test.environment, test.run) for test in driver.made} == rests_on(world, driver.facts)
    assert len(driver.made) == len(driver.known.outcomes)


def rests_on(world, facts):
    """The tests, as (environment, run), behind the baseline, the verdicts and the claims."""
    tests = set()
    for fact in facts:
        match fact:
            case ("failure_fixed", runs):
                tests |= {(world.whole, run) for run in range(runs)}
            case ("judged", _, environment, _, runs):
                tests |= {(environment, run) for run in range(runs)}
            case ("certified", made):
                first = made.certificate.first_run
                named = (test for claim in made.claims for test in claim.claim.rests_on)
                tests |= {(environment, first + run) for environment, run in named}
            case ("stepped_back", _, _, fresh):
                tests |= set(fresh)
    # Without a failure no baseline is over.
    return tests or {(world.whole, run) for run in range(world.baseline_runs)}


@given(world=worlds, part=st.floats(0, 1), workers=st.integers(1, 4))
def test_driven_again_through_what_is_known_it_comes_to_the_same_end(world, part, workers):
    whole, end = driven(world, workers=workers)
    killed = Driver(world, workers, order=1)
    killed.interrupt = int(part * whole.steps), Killed()
    killed.drive(begun(killed))
    resumed, again = driven(world, known=deepcopy(killed.known))
    assert again == end
    assert rounds(resumed.facts) == rounds(whole.facts)
    # From the last leg, as an engine does that is started again.
    if killed.searches:
        search, now, before = killed.searches[-1]
        resumed = Driver(world, known=deepcopy(killed.known))
        resumed.now, resumed.searches = deepcopy(now), [killed.searches[-1]]
        assert resumed.drive(begun(resumed, search)) == end
        assert rounds(resumed.facts) == rounds(whole.facts[before:])


def rounds(facts):
    """What a round that is known already does not tell again is left out."""
    return [fact for fact in facts if fact[0] not in ("judged", "similar", "round_ended")]


@given(world=worlds)
def test_where_all_is_known_no_test_is_made(world):
    whole, end = driven(world)
    again, same = driven(world, known=deepcopy(whole.known))
    assert (again.made, same) == ([], end)
    # Verdicts follow from the tests alone: without the past they are given again.
    told, same = driven(world, known=Known(dict(whole.known.outcomes)))
    assert (told.made, told.facts, same) == ([], whole.facts, end)


@given(world=worlds, part=st.floats(0, 1), workers=st.integers(1, 9))
@examples(0.5)
def test_where_a_decision_ends_a_search_it_goes_on_with_another(world, part, workers):
    whole, _ = driven(world, workers=workers)
    driver = Driver(world, workers)
    driver.interrupt = max(1, int(part * whole.steps)), Changed()

    def start_search():
        decided.append(driver.search())
        return decided[-1]

    decided, driver.start_search = [], start_search
    try:
        end = driver.drive(begun(driver))
    except Changed:
        # The baseline is no search.
        assert not driver.searches
    if not decided:
        return
    search, now, told = next(one for one in driver.searches if one[0] is decided[0])
    other = Driver(world, workers)
    other.now, other.searches = deepcopy(now), [(search, now, 0)]
    assert other.drive(begun(other, search)) == end
    assert driver.facts[told:] == other.facts
    began = next(fact for fact in other.facts if fact[0] in ("round_began", "search_ended"))
    assert began[0] == "search_ended" or began[1] == search.first_round


drifting = st.builds(
    World,
    labels=st.integers(4, 5).map(lambda count: tuple(range(count))),
    needed=st.just(Environment.of([0])),
    useful=st.sets(st.integers(1, 3), min_size=2, max_size=2).map(Environment.of),
    algorithm=st.sampled_from(ALGORITHMS),
    seed=st.integers(0, 10**6),
    keeps_rate=st.booleans(),
    factor=st.just(0.5),
)


@given(world=drifting)
@examples(0.5)
def test_nothing_that_lost_the_rate_is_taken_again(world):
    driver, end = driven(world, workers=8)
    chain, lost, of_whole = [world.whole], [], {}
    for fact in driver.facts:
        match fact:
            case ("failure_fixed", times):
                of_whole |= {run: world.outcome(world.whole, run) for run in range(times)}
            case ("judged", _, environment, verdict, times) if any(
                environment <= one for one in lost
            ):
                assert (verdict, times) == ("missed", 0)
            case ("similar" | "left_out", *_, environment):
                assert not any(environment <= one for one in lost)
                chain.append(environment)
            case ("certified", certified):
                first = certified.certificate.first_run
                tests = {test for claim in certified.claims for test in claim.claim.rests_on}
                there = takewhile(lambda run, tests=tests: (world.whole, run) in tests, count())
                runs = {first + run for run in there}
                of_whole |= {run: world.outcome(world.whole, run) for run in runs}
            case ("stepped_back", back, *_):
                rate = estimated_rate(sum(of_whole.values()), len(of_whole))
                assert back == place(world, chain, certified, rate)
                lost.append(chain[back + 1])
                del chain[back + 1 :]
    assert end is None or end.claims[0].environment == chain[-1]


def place(world, chain, certified, rate):
    """The last environment with the rate of all runs of the whole world, by the seeds of a
    certificate.
    """
    first, lost = certified.certificate.first_run, certified.claims[0].runs

    def fresh(environment, run):
        return world.outcome(environment, first + run)

    lost_rate = sum(fresh(chain[-1], run) for run in lost) / len(lost)
    return last_good(
        chain, lambda environment: settle(good_enough(environment, rate, 0.8, lost_rate), fresh)
    )


def test_the_worlds_of_these_tests_come_to_all_steps():
    """Else they would prove little."""
    seen, ends = set(), set()
    for seed in range(8):
        world = World(
            tuple(range(5)),
            Environment.of([0]),
            Environment.of([2, 4]),
            "ddmin",
            seed,
            0.8,
            iterations=0,
        )
        driver, end = driven(world, workers=8)
        seen |= {fact[0] for fact in driver.facts}
        ends |= {claim.claim.verdict for claim in end.claims} if end else set()
    told = {
        "round_began",
        "judged",
        "similar",
        "round_ended",
        "search_ended",
        "certified",
        "stepped_back",
        "left_out",
    }
    assert seen >= told
    assert ends >= {"kept", "needed"}


def nothing(elements, guide):
    """An algorithm that leaves all as it is."""
    return Environment.of(elements)
    yield


def certified_alone(world, vetoed=()):
    """What follows from a certificate of the whole world."""
    driver = Driver(world)
    driver.algorithm = lambda search: nothing(search.chain[-1], None)
    driver.vetoed = {world.whole - Environment.of([model]) for model in vetoed}
    free = {model: Environment.of([model]) for model in world.whole}
    search = Search(
        first_round=1,
        whole=world.whole,
        chain=(world.whole,),
        pinned=Environment(),
        free=free,
        rule=Acceptance(most_misses=1),
    )
    driver.drive(begun(driver, search), most=2000)
    return [fact[1] for fact in driver.facts if fact[0] == "left_out"]


def test_what_is_not_needed_goes_and_a_refused_model_does_not_hide_another():
    world = World(tuple(range(3)), Environment.of([2]), Environment(), "ddmin", 1, rate=1.0)
    assert certified_alone(world)[0] == 0
    assert certified_alone(world, vetoed=[0])[0] == 1
    assert certified_alone(world, vetoed=[0, 1]) == []


def test_a_candidate_that_the_user_wants_after_all_is_looked_at_again():
    world = World((0, 1, 2), Environment.of([0]), Environment(), "ddmin", 1, rate=1.0)
    candidates = [Environment.of(models) for models in ([0, 1], [1], [2], [0])]
    driver = Driver(world)
    driver.vetoed = {candidates[0]}
    judging = judge(driver, candidates, Acceptance(most_misses=2), "hand")
    driver.drive(judging, most=3)
    assert driver.facts == [("judged", 1, candidates[1], "dissimilar", 2)]
    driver.vetoed, driver.refusals = set(), 1
    assert driver.drive(judging) == 0
    assert driver.facts[-1] == ("judged", 0, candidates[0], "similar", 1)
    # One that is refused after it was found similar is passed over.
    driver.vetoed = set(candidates[:1])
    assert driver.drive(judge(driver, candidates, Acceptance(most_misses=2), "hand")) == 3
