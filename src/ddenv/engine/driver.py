"""Carries a run through: drives the procedure with workers and a run file, and records what it
finds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import cycle, islice
from typing import NoReturn

from ddenv.engine.control import Control, Stopped
from ddenv.engine.journal import Journal
from ddenv.engine.judging import SchemaInputs, fix_failure, known_failure, rows_of, spec_of
from ddenv.engine.limits import limit_after
from ddenv.engine.notes import note, note_alike, note_ends, note_price, note_rare
from ddenv.engine.scheduler import TestScheduler
from ddenv.engine.slicing import compare, slice_audit, slice_environment
from ddenv.engine.worker import Broken
from ddenv.environment import NOTHING, Environment, Numbers
from ddenv.errors import UserError
from ddenv.evidence.certificate import RUNS_BESIDE, RUNS_BESIDE_ALIKE, SURELY, NumberedRun, error_of
from ddenv.evidence.claims import current, is_minimal, terms_of
from ddenv.evidence.ends import elsewhere, ends_of, of_baseline
from ddenv.evidence.rates import anytime_interval, estimated_rate, iterations_needed
from ddenv.reduction import procedure as steps
from ddenv.reduction.algorithms import tried_again
from ddenv.reduction.evidence import Evidence, Trial
from ddenv.reduction.guide import begin_search, make_guide
from ddenv.reduction.round import Partition, Round, Rounds, Stacks
from ddenv.reduction.verdict import Acceptance
from ddenv.robot.drake.terrain_boxes import note_terrain
from ddenv.robot.settled import notes_on
from ddenv.runfile import events
from ddenv.runfile.fold import digest
from ddenv.runfile.fold_decisions import broken_runs, exact_runs, stands_for_all
from ddenv.runfile.progress import Certificate, Node
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import BROKEN, CERTIFY, Test
from ddenv.runfile.supports import stacks_of
from ddenv.runs.tests_left import search_tests
from ddenv.schemas import split_pair
from ddenv.text import count
from ddenv.words.claims import verdict_on
from ddenv.world.files.floor_error import note_pieces
from ddenv.world.model import World
from ddenv.world.placement import note_unseen
from ddenv.world.scenario import Reduction, Scenario

# Another failure competes to be f if it shows at least once where f shows so often. Rarer ones
# hardly ever win by luck.
COMPETES = 4
# A resumed run would not repeat the rounds that it made before.
OTHER_WAY = (
    "round {} would now differ: the run was started with other versions of ddenv, scikit-learn "
    "or a package of schemas; "
    "continue with those, or start a new run"
)
NOT_EXACT = (
    "runs do not repeat, so nothing exact can be said of them; keep the rate of f instead: "
    "--accept-rate kept"
)
NO_MODEL = (
    "fails without any model: look at the ground, the robot, its controller, or something that "
    "is missing"
)
# Of a rarer f no few replays say whether it still shows.
FEWEST_REPLAYS = 3
MOST_REPLAYS = 60
# To reduce a single run exactly takes so many of the whole world if they are alike: one shows f,
# the other that it repeats.
ENOUGH_ALIKE = 2
LEFT_OVER = "does the simulator keep something between its runs, such as a cache or a count?"
CHANGED = "a decision of the user ended the certificate; resume the run to continue from there"


class Driver:
    """One engine's work on one run. All decisions follow from the journal, so a resumed run
    continues in the same way.
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World,
        journal: Journal,
        scheduler: TestScheduler,
        control: Control,
    ) -> None:
        self._scenario = scenario
        self._world = world
        self._reduction = scenario.reduction
        self._journal = journal
        self._scheduler = scheduler
        self._control = control
        self._sight = SchemaInputs(
            world, journal.state.elements, self._reduction.delta, self._reduction.seed
        )
        # What the schemas know: the tests behind the verdicts of rounds that are over, each once.
        self._trials: dict[int, Trial] = {}
        self._unknown: set[Environment] = set()
        # Of the current search: they are there once it has begun.
        self._current_search: steps.Search
        self._stacks: Stacks
        self._evidence: Evidence
        # What the baseline shows so far, or why there is nothing to reduce.
        self._baseline: events.BaselineFinished | str = ""
        # How many runs of what is left a new certificate needs at least; None if the search makes
        # it when it is over.
        self._only_certify: int | None = None
        # The share of the rate up to which the last certificate goes on, with all its runs.
        self._certify_rate: float | None = None
        # What the procedure asks of what is known.
        self.shown = journal.shown
        self.rate = journal.rate_of_whole
        self.refused = journal.is_refused
        self.refused_by_user = journal.is_refused_by_user

    def reduce(self) -> None:
        """The whole run. Raises Stopped, and UserError when it cannot go on."""
        journal = self._journal
        reduction = self._reduction
        # Unknown names are refused before a robot runs.
        self.algorithm(
            steps.Search(
                first_round=1,
                whole=NOTHING,
                chain=(NOTHING,),
                pinned=NOTHING,
                free={},
                rule=Acceptance(most_misses=1),
            )
        )
        self._settle()
        search = None if journal.state.baseline is None else self._first_search()
        whole = journal.state.environments[0]
        keeps_rate = reduction.accept_rate == "kept"
        alike = ENOUGH_ALIKE if settings(journal.state).reduces_one_run else None
        procedure = steps.procedure(
            self, whole, reduction.baseline_runs, keeps_rate, search, enough_alike=alike
        )
        if self._scheduler.carry_out(procedure) is None:
            self._end(False, str(self._baseline))
        else:
            self._conclude()

    def _settle(self) -> None:
        """Finds which models support others, once. Raises UserError if stacks are to be kept
        together and it cannot be found.
        """
        scenario = self._scenario
        journal = self._journal
        needed = self._reduction.keep_supports
        moves = any(model.links and not model.static for model in self._world.models)
        # A simulator in Python names the models that affected a run, and those that they rest on.
        in_python = scenario.oracle is not None and scenario.oracle.use is not None
        if (
            (not moves or (in_python and not needed))
            and self._reduction.slice
            and journal.state.ties is None
        ):
            journal.record(events.Still())
        if (
            journal.state.ties is not None
            or journal.state.unsettled
            or journal.state.supports
            or not moves
        ):
            return
        why = (
            "only ddenv's own simulator finds which models rest on which; leave it out, or 'oracle'"
        )
        if scenario.oracle is None:
            found = self._scheduler.settle()
            if not isinstance(found, Broken):
                for about, words in notes_on(self._world, found.settled):
                    note(journal, about, words)
                ties = None if found.ties is None else journal.pairs(found.ties)
                journal.record(events.Supports(pairs=journal.pairs(found.supports), ties=ties))
                return
            why = f"it is not known which models rest on which: {found.failure}"
            if not needed:
                journal.record(events.Supports(pairs=(), why=found.failure))
        if needed:
            raise UserError(f"reduction.keep_supports: {why}")

    def certify(self, at_least: int, certify_rate: float | None = None) -> None:
        """Makes one more certificate of the current environment, and goes neither back nor on.
        Raises as `reduce`.

        With a `certify_rate` the last certificate goes on, with all its runs, until it shows that
        this share of the rate is kept.
        """
        self._certify_rate = certify_rate
        # A search that is due would begin at the end.
        search = self._next_search()
        self._only_certify = at_least
        chain = tuple(
            self._journal.state.environments[node.id] for node in self._journal.state.path
        )
        try:
            self._scheduler.carry_out(steps.certify(self, search, chain))
        except steps.Changed:
            self.start_search()
            raise Stopped(CHANGED) from None
        self._conclude()

    def _first_search(self) -> steps.Search:
        """The search of an engine that starts after the baseline, or at its end."""
        self._control.search_begins()
        # An engine that was killed may not have compared its last one.
        compare(self._journal, self._journal.state.finished_tests)
        # The user may have gone back before this engine started; then it pauses there.
        if self._journal.state.search_due:
            with suppress(steps.Changed):
                self._scheduler.wait_for_search()
        return self.start_search()

    def start_search(self) -> steps.Search:
        slice_environment(self._journal)
        return self._next_search()

    def _next_search(self) -> steps.Search:
        journal = self._journal
        if journal.state.search is None or journal.state.search_due:
            self._check_repeats()
            before = journal.state
            first = 1 if before.round is None else before.round.number + 1
            if before.scenario["reduction"]["accept_rate"] == "kept":
                rate = journal.rate_of_whole()
            else:
                rate = 0.0
            journal.record(
                events.LegStarted(
                    round=first, n_partitions=before.nodes[before.node].n_partitions, rate=rate
                )
            )
        search = journal.state.search
        assert search is not None
        self._reduction = Reduction.model_validate(search.settings)
        # It may leave out whole stacks, and none with a model that is pinned.
        state = journal.state
        asked = self._reduction
        exact = exact_runs(journal.state)
        together = Stacks.of(
            map(journal.models, stacks_of(state, state.nodes[search.node].environment))
        )
        stays = journal.models(search.pinned)
        stays |= together.of_any(stays)
        free = {
            model: stack for model, stack in together.by_first.items() if stack.isdisjoint(stays)
        }
        rule = Acceptance(
            most_misses=1 + asked.iterations,
            rate=search.rate,
            keep_rate=asked.keep_rate,
            steps_back=search.steps_back,
            broke=broken_runs(state),
        )
        rule = self._scheduler.rule = (
            Acceptance(most_misses=len(exact), exact=exact) if exact else rule
        )
        chain = tuple(state.environments[node.id] for node in self._nodes(search.node))
        self._current_search = steps.Search(
            first_round=search.first_round,
            whole=journal.whole,
            chain=chain,
            pinned=stays,
            free=free,
            rule=rule,
            n_partitions=search.n_partitions,
            again=search.again,
        )
        self._trials = {}
        self._unknown = set()
        self._learn(search.tests, search.evidence_test)
        return self._current_search

    def _check_repeats(self) -> None:
        """Raises UserError if the first search that reduces chosen runs exactly begins, and one of
        them does not repeat.
        """
        journal = self._journal
        exact = exact_runs(journal.state)
        last = journal.state.search
        if not exact or (last is not None and last.settings["accept_rate"] == "exact"):
            return
        if stands_for_all(journal.state):
            # Other seeds have repeated it. The runs behind the result are replayed at the end.
            return
        test = journal.test(journal.whole, exact[0])
        if (
            test is not None
            and test.phase == "baseline"
            and self._scheduler.made_again(test) is not None
        ):
            raise UserError(
                f"reduction.accept_rate: exact needs runs that repeat, but run {test.run + 1} of "
                f"the whole world, replayed with seed {test.seed}, differs; keep its rate: "
                "--accept-rate kept"
            )

    def _nodes(self, node: int) -> tuple[Node, ...]:
        """The way to a node, from where the same failures counted as f as now."""
        path = self._journal.state.changed(node=node).path
        begin = max(
            place
            for place, one in enumerate(path)
            if place == 0 or one.how in ("accepted", "instead")
        )
        return path[begin:]

    # What the procedure asks.

    @property
    def refusals(self) -> int:
        return self._journal.state.refusals

    @property
    def workers(self) -> int:
        if self._control.speculates():
            return max(1, self._journal.state.jobs)
        return 1

    def goes_on(self) -> bool:
        # Whoever accepts each reduction by hand also goes back by hand.
        automatic = self._journal.state.accept_mode == "automatic"
        return self._only_certify is None and automatic and self._reduction.accept_rate == "kept"

    def algorithm(self, search: steps.Search) -> Rounds:
        """The algorithm and the schemas by name. Raises UserError for unknown ones."""
        asked = self._reduction
        self._stacks = Stacks(search.free)
        guide = make_guide(
            *split_pair(asked.pair),
            # Only rounds use it, after the first similar run.
            lambda: replace(self._evidence, trials=tuple(self._trials.values())),
            n_partitions=search.n_partitions or asked.n_partitions,
            rate=lambda: search.rule.rate or known_failure(self._journal.state).rate,
            runs=lambda: search.rule.misses,
            # The algorithm knows one model of each stack.
            broke=lambda candidate: (
                search.pinned | Environment.of(self._stacks.expanded(candidate.models))
                in self._unknown
            ),
            proves=search.rule.proves,
            **{
                name: getattr(asked, name)
                for name in ("prior", "candidates", "complement_order", "growth", "skip")
            },
        )
        searched = partial(begin_search, asked.algorithm, guide=guide)
        return self._stacks.expand(
            tried_again(self._stacks.representatives, search.again, searched)
        )

    def _learn(self, tests: Iterable[int], similar: int | None) -> None:
        """The schemas see the tests behind the verdicts of a round, and the last similar run: a
        resumed run sees the same.
        """
        state = self._journal.state
        for test in (state.test(number) for number in tests):
            if not test.broke:
                environment = state.environments[test.environment]
                self._trials[test.id] = Trial(environment, test.shows_f, state.elements)
        if similar is not None:
            self._evidence = self._sight.evidence(self._journal, similar)

    # What the procedure finds.

    def baseline_ran(self, runs: int, chose: int) -> steps.Baseline | None:
        journal = self._journal
        whole = self._journal.state.environments[0]
        tests = [journal.state.test(test) for test in journal.tests(whole, range(runs))]
        trajectories = {
            test.id: rows_of(journal.file, test.id) for test in tests if test.outcome == "failed"
        }
        asked = self._reduction
        found = self._baseline = fix_failure(
            tests,
            trajectories,
            spec=spec_of(journal.state),
            iterations=asked.iterations,
            wanted=settings(journal.state).failure,
            chose=chose,
            usual=asked.baseline_runs,
        )
        if isinstance(found, str):
            return None
        found = self._baseline = replace(
            found, alike=found.failures == runs > 1 and self._alike(tests)
        )
        f, *others = sorted(found.seen, key=lambda one: one.test != found.failure_test)
        competed = any(COMPETES * one.runs >= f.runs for one in others)
        return steps.Baseline(found.failures, competed, found.alike)

    def _alike(self, tests: Sequence[Test]) -> bool:
        """Whether the robot and all that moved went the same way in these tests, to the last
        bit.
        """
        first, *others = (self._journal.file.samples(test.id) for test in tests)
        return all(other == first for other in others)

    def failure_fixed(self, runs: int) -> steps.Search:
        assert not isinstance(self._baseline, str)
        limit = limit_after(self._journal.state, self._scenario.failure.timeout)
        self._journal.record(replace(self._baseline, wall_limit=limit))
        note_alike(self._journal)
        scatters = note_ends(self._journal) and self._reduction.accept_rate == "kept"
        if note_rare(self._journal) or scatters:
            self._control.offered()
        self._control.round_finished()
        return self._first_search()

    def round_began(self, number: int, round: Round) -> steps.Past | None:
        state = self._journal.state
        search = self._journal.state.search
        parts = tuple(map(Environment.of, round.partitions))
        assert search is not None
        if search.first_round + len(search.past) > number:
            past = search.past[number - search.first_round]
            if past.digest != digest(parts):
                raise UserError(OTHER_WAY.format(number))
            self._learn(past.tests, past.evidence_test)
            self._unknown.update(
                round.candidates[index].models | self._current_search.pinned
                for index in past.unknown
            )
            return steps.Past(past.winner)
        if state.round is None or state.round.number < number:
            self._announce(number, round)
        elif state.round.split.parts != parts:
            raise UserError(OTHER_WAY.format(number))
        # Whoever waits before the first test of a round sees its candidates.
        self._audit_slice()
        return None

    def _announce(self, number: int, round: Round) -> None:
        journal = self._journal
        search = self._current_search
        # These schemas score by distance in m, which is useful to show.
        shown = self._reduction.algorithm == "ddenv" and self._reduction.pair.endswith("-proximal")
        scores = [float(f"{score:.3f}") if shown else None for score in round.scores]
        environment = Environment.of(round.environment) | search.pinned
        journal.record(
            events.RoundStarted(
                round=number,
                n_partitions=round.n_partitions,
                environment=journal.number(environment),
                partitions=tuple(tuple(sorted(part)) for part in round.partitions),
                candidates=tuple(
                    (one.kind, one.partition, scores[one.partition]) for one in round.candidates
                ),
                pinned=search.pinned & environment,
            )
        )
        models = sum(stack <= environment for stack in search.free.values())
        expected = search_tests(models, self._reduction, known_failure(journal.state).rate)
        journal.record(
            events.Forecast(round=number, tests=expected, tests_done=journal.state.tests_done)
        )
        refused = {refusal.environment: refusal.verdict for refusal in journal.state.refused}
        for index, one in enumerate(round.candidates) if refused else ():
            if verdict := refused.get(one.models | search.pinned):
                journal.record(
                    events.Vetoed(round=number, candidate=index, verdict=verdict, again=True)
                )

    def judged(self, index: int, environment: Environment, verdict: str, runs: int) -> None:
        """Records a verdict, unless an earlier engine has."""
        journal = self._journal
        round = self._journal.current
        if verdict == "unknown":
            self._unknown.add(environment)
        if round.candidates[index].verdict:
            return
        tests = journal.tests(environment, map(self._current_search.rule.run, range(runs)))
        journal.record(
            events.CandidateJudged(
                round=round.number, candidate=index, verdict=verdict, tests=tests
            )
        )

    def similar(self, number: int, index: int, environment: Environment) -> bool:
        """In accept mode `ask`, waits for the user, who may also choose an earlier candidate."""
        journal = self._journal
        if journal.current.winner == index:
            return True
        if journal.state.accept_mode == "ask" and journal.current.accepted != index:
            journal.record(events.Waiting(round=number, candidate=index))
            while journal.state.accept_mode == "ask" and journal.state.waiting_candidate == index:
                self._scheduler.tick()
            if journal.state.waiting_candidate == index:
                journal.record(events.Decided(round=number, candidate=index, decision="accept"))
            if journal.current.accepted != index:
                return False
        test = journal.evidence_of(journal.current.candidates[index].tests)
        journal.record(
            events.Reduced(
                round=number,
                candidate=index,
                environment=journal.number(environment),
                evidence_test=test,
            )
        )
        return True

    def round_ended(self, number: int, winner: int | None) -> None:
        journal = self._journal
        if not journal.current.done:
            journal.record(events.RoundFinished(round=number))
            self._control.round_finished()
        assert journal.state.search is not None
        past = journal.state.search.past[-1]
        self._learn(past.tests, past.evidence_test)
        if winner is None and self._scenario.oracle is not None:
            self._check_shows(number)
        if winner is not None and slice_environment(journal):
            # The search goes on in the slice.
            raise steps.Changed

    def _check_shows(self, round: int) -> None:
        """Replays runs that showed f, if no test of a round did. Raises UserError if f does not
        show any more.

        Only another simulator can change in the course of time.
        """
        state = self._journal.state
        shown = [test for test in state.tests if test.shows_f]
        failing = [test for test in shown if test.phase == "baseline"]
        base = known_failure(state)
        replays = max(
            FEWEST_REPLAYS, 1 + iterations_needed(estimated_rate(base.failures, base.runs), SURELY)
        )
        if not failing or replays > MOST_REPLAYS or any(test.round == round for test in shown):
            return
        for replay, test in enumerate(islice(cycle(failing), replays)):
            result = self._scheduler.made_again(test, tells=not replay)
            # A replay that broke says nothing of f.
            if result is None or self._scheduler.outcome_of(result) in ("similar", *BROKEN):
                return
        last = max(test.id for test in shown)
        raise UserError(
            f"f does not repeat: it showed only in the first {count(last, 'run')}, and in none of "
            f"{count(replays, 'replay')}; {LEFT_OVER}"
        )

    def search_ended(self, environment: Environment) -> None:
        self._audit_slice()
        # Their results count, too.
        self._scheduler.finish_trials()

    def _audit_slice(self) -> None:
        while tests := slice_audit(self._journal):
            self._scheduler.work(tests)

    def certificate_due(self) -> steps.Certificate:
        """The certificate that this search has already, or a new one; a finished one only if no
        other is asked for.
        """
        journal = self._journal
        last = self._journal.state.certificate
        if last is None or (self._only_certify is not None and last.claims):
            asked = self._reduction
            number = len(journal.state.certificates) + 1
            # What the bets have won so far holds for any share, so that the same ones can go on.
            if last is not None and self._certify_rate is not None and not last.seeds:
                before = last
            else:
                before = None
            # Where chosen runs were reduced, a rate is shown if the user asks for one.
            exact = () if self._certify_rate else self._current_search.rule.exact
            shown = [run for run in exact if journal.shown(journal.environment, run)]
            seeds = tuple(
                journal.state.test(test).seed for test in journal.tests(journal.environment, shown)
            )
            beside = RUNS_BESIDE_ALIKE if stands_for_all(journal.state) else RUNS_BESIDE
            if seeds:
                at_least = max(self._only_certify or 0, beside)
            else:
                at_least = self._only_certify or asked.baseline_runs
            first, error = (
                (before.first_run, before.error)
                if before
                else (journal.fresh_run, error_of(number))
            )
            rate = journal.rate_of_whole()
            share = self._certify_rate or asked.certify_rate
            note_price(journal, share, at_least)
            started = events.CertificateStarted(
                certificate=number,
                run=first,
                rate=rate,
                keep_rate=asked.keep_rate,
                error=error,
                at_least=at_least,
                certify_rate=share,
                seeds=seeds,
            )
            journal.record(started)
            last = journal.state.certificates[-1]
        terms = terms_of(journal.state, last)
        return steps.Certificate(
            last.first_run, terms, self._current_search.rule.exact if last.seeds else ()
        )

    def certified(self, made: steps.Certified) -> None:
        if not self._certificate.claims:
            first = made.certificate.first_run
            journal = self._journal
            chosen = [
                test
                for one in made.claims
                for test in journal.tests(one.environment, made.certificate.exact)
            ]
            exactly = not chosen or self._all_repeat(chosen)
            claims = tuple(self._claim_made(claim, first, exactly) for claim in made.claims)
            rested_on = journal.full_tests(
                (test for one in made.claims for test in one.claim.rests_on), first
            )
            tests = tuple(sorted({*rested_on, *chosen}))
            journal.record(
                events.CertificateFinished(
                    claims=claims, tests=tests, elsewhere=self._elsewhere(tests)
                )
            )
        self._end_early_stop_if_refuted()

    def _end_early_stop_if_refuted(self) -> None:
        """Ends early stop where what is left is lost, and f in tests that ended early had accepted
        it.
        """
        journal = self._journal
        certificate = self._certificate
        if certificate.claims[0].verdict != "lost" or not journal.stops_early:
            return
        state = journal.state
        accepted = (test for node in self._nodes(state.node) for test in state.tests_of(node.runs))
        if any(test.cut and test.outcome == "similar" for test in accepted):
            journal.record(events.EarlyStopEnded(certificate=certificate.number))

    def _elsewhere(self, tests: Numbers) -> events.EndsElsewhere | None:
        """Whether what is left ended elsewhere in these tests than f did in the baseline, within
        epsilon.
        """
        state = self._journal.state
        epsilon = spec_of(state).epsilon
        # Where another failure counts as f, the baseline says nothing of its ends.
        if self._certificate.branch or len(state.failures) > 1:
            return None
        left = state.nodes[state.node].id
        fresh = [
            test
            for test in state.tests_of(tests)
            if test.phase == CERTIFY and test.environment == left
        ]
        return elsewhere(ends_of(of_baseline(state), "similar"), ends_of(fresh, "similar"), epsilon)

    def _all_repeat(self, tests: Iterable[int]) -> bool:
        """Replays what an exact reduction rests on, up to a run that differs.

        Where some runs do not repeat, one that showed or missed f by chance may have misled it.
        """
        journal = self._journal
        for test in (journal.state.test(number) for number in tests):
            repeats = self._scheduler.made_again(test) is None
            if journal.state.search_due:
                raise steps.Changed
            if not repeats:
                note(
                    journal,
                    f"replay {test.id}",
                    f"test {test.id}, replayed with seed {test.seed}, differs: {NOT_EXACT}",
                )
                return False
        return True

    @property
    def _certificate(self) -> Certificate:
        if self._journal.state.certificate is None:
            raise Stopped(CHANGED)
        return self._journal.state.certificate

    def _claim_made(self, named: steps.NamedClaim, first: int, exactly: bool) -> events.ClaimMade:
        journal = self._journal
        runs = named.exact or [first + run for run in named.runs]
        tests = journal.tests(named.environment, runs, full=not named.exact)
        outcomes = Counter(journal.state.test(test).outcome for test in tests)
        shown = outcomes["similar"]
        sound = outcomes.total() - sum(outcomes[outcome] for outcome in BROKEN)
        number = journal.number(named.environment)
        claim = named.claim
        share = shown / max(1, sound)
        low, high = (share, share) if named.exact else anytime_interval(shown, sound)
        return events.ClaimMade(
            without=named.model,
            environment=number,
            verdict="not shown" if named.exact and not exactly else claim.verdict,
            shown=shown,
            runs=sound,
            low=low,
            high=high,
            outcomes=dict(outcomes),
            bound=claim.bound,
        )

    def stepped_back(
        self, place: int, again: tuple[Partition, ...], tests: tuple[NumberedRun, ...]
    ) -> NoReturn:
        journal = self._journal
        nodes = self._nodes(journal.state.node)
        node = nodes[place].number
        lost = nodes[place + 1].number
        journal.record(
            events.RateLost(node=node, lost=lost, again=again, tests=journal.full_tests(tests))
        )
        self._scheduler.wait_for_search()

    def left_out(self, model: int, environment: Environment) -> NoReturn:
        journal = self._journal
        first = self._certificate.first_run
        runs = range(first, journal.fresh_run)
        evidence = journal.evidence_of(journal.tests(environment, runs, full=True))
        journal.record(
            events.LeftOut(
                without=model, environment=journal.number(environment), evidence_test=evidence
            )
        )
        self._scheduler.wait_for_search()

    # The end.

    def _conclude(self) -> None:
        journal = self._journal
        certificate = current(journal.state)
        if certificate is None or journal.state.search_due:
            raise Stopped(CHANGED)
        stacks = stacks_of(journal.state, journal.state.environment)
        together = self._reduction.keep_supports or any(len(stack) > 1 for stack in stacks)
        pinned = self._current_search.pinned & journal.environment
        left = certificate.claims[0]
        # Where what is left is lost, f still shows in the whole world.
        is_gone = left.verdict == "not shown" and not left.shown
        vanished = "f does not repeat; " if is_gone else ""
        bare = "" if journal.environment else f"{NO_MODEL}; "
        reason = (
            bare
            + vanished
            + verdict_on(certificate, len(pinned), "stack" if together else "single model")
        )
        spare = [claim.without for claim in certificate.claims if claim.verdict == "not needed"]
        if any(
            journal.is_refused_by_user(journal.without(name)) for name in spare if name is not None
        ):
            reason += "; leaving it out was vetoed or rejected"
        if together:
            reason += f"; stacks were kept together ({count(len(stacks), 'stack')})"
        self._end(is_minimal(certificate), reason)

    def _end(self, minimal: bool, reason: str) -> None:
        self._scheduler.finish_trials()
        left = self._journal.state.environment
        unlike = [*note_unseen(self._world, left), *note_pieces(self._world, left)]
        if self._scenario.oracle is None:
            unlike += note_terrain(self._world, self._scenario, left)
        for about, words in unlike:
            note(self._journal, about, f"what is left has {words}")
        # Tests of later candidates are no longer needed.
        self._journal.lose_running()
        self._journal.record(events.Finished(minimal=minimal, reason=reason))
