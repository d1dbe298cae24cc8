"""The reasons to choose from once an outcome is seen: why it came, what it means, and what is wrong with the other answers."""

from __future__ import annotations

from ddenv.learn.lesson import Answer, Question
from ddenv.runfile.run_settings import Settings
from ddenv.runfile.state import Candidate, Round, Test


def why_ended(test: Test, candidate: Candidate, options: Settings) -> Question:
    """What the outcome of a candidate's test means."""
    gone = "the models of the part" if candidate.kind == "complement" else "all models outside the part"
    if test.outcome == "similar":
        # Of a single model nobody would be wrong to call it the smallest world.
        return Question(
            "f showed. What does that mean?", _turned(_of_f(gone, options)[: 3 if candidate.size > 1 else 2], test.id)
        )
    if test.outcome == "other":
        return Question("It failed, but not as in f. What does that mean?", _turned(_OF_OTHER, test.id))
    once = options.iterations == 0 and options.accept_rate == "first"
    return Question("The goal was reached. What does that mean?", _turned(_OF_ONLY_MISS if once else _OF_MISS, test.id))


def why_won(round: Round) -> Question:
    """Why a candidate of a round showed f, or none did."""
    if round.winner is None:
        return Question("None of them showed f. What does that mean?", _turned(_of_vain_round(round), round.number))
    won = round.candidates[round.winner]
    before = "Those before it probably lack something." if won.index else "It was the first one to be tried."
    answers = (
        Answer("It still has everything that f needs.", True, before),
        Answer(
            "The models that it leaves out caused f.",
            False,
            "They were not there, and f showed all the same. So f does not need them.",
            "part",
        ),
        Answer(
            "It has more models than the others.",
            False,
            "It does not matter how many there are. If a single one that f needs is missing, f is gone.",
            "fewer",
        ),
    )
    return Question(f"{_capital(won.label)} showed f. Why?", _turned(answers, round.number))


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _of_f(gone: str, options: Settings) -> tuple[Answer, ...]:
    goes = f"f shows without {gone}: they can go."
    if options.iterations and options.accept_rate == "first":
        goes = f"f showed without {gone}. Here the first run with f decides, so they go."
    elif options.accept_rate != "first":
        goes = f"f can show without {gone}. Whether it shows often enough, more runs will say."
    return (
        Answer("Everything that f needs is still there.", True, goes),
        Answer(
            "The models that were left out caused f.",
            False,
            "They were not there, and f showed all the same. So f does not need them.",
            "part",
        ),
        Answer(
            "This is the smallest world that shows f.",
            False,
            "Nobody knows: there are smaller ones that were not tried.",
            "smallest",
        ),
    )


_OF_OTHER = (
    Answer(
        "It may have another cause, so it does not count as f.",
        True,
        "Only an end like that of f counts. This one is elsewhere, or came about otherwise.",
    ),
    Answer("Any failure is good enough: this is f.", False, "Only the same failure counts, close to f's end.", "any"),
    Answer(
        "The test is broken: fewer models cannot make the robot fail.",
        False,
        "With fewer models the robot can take another path, and find another trap.",
        "fewer",
    ),
)
_ALWAYS_THROUGH = Answer(
    "With fewer models the robot always gets through.",
    False,
    "Not always: fewer models can open a path into another trap.",
    "fewer",
)
_OF_MISS = (
    Answer(
        "Something that f needs is probably gone.",
        True,
        "Probably: one miss can be bad luck where a failure is flaky. That is why tests are repeated.",
    ),
    Answer(
        "Now it is proved that f needs what was left out.",
        False,
        "It may have been bad luck: one test proves little.",
        "proof",
    ),
    _ALWAYS_THROUGH,
)
# Where each candidate has one run.
_OF_ONLY_MISS = (
    Answer(
        "Something that f needs is gone.",
        True,
        "This search runs each candidate once, so a single miss decides.",
    ),
    Answer(
        "It was bad luck: another run would show f.",
        False,
        "That can happen where a failure is flaky. This search runs each candidate once, and takes the miss as its answer.",
    ),
    _ALWAYS_THROUGH,
)


def is_last(round: Round) -> bool:
    """Whether the round leaves out each model alone: without f it is the last one."""
    alone = {one.partition for one in round.candidates if one.kind == "complement"}
    return len(alone) == len(round.partitions) == len(round.environment)


def _of_vain_round(round: Round) -> tuple[Answer, ...]:
    lacks = "Each of them lacks something that f needs."
    if is_last(round):
        return (
            Answer(lacks, True, "Each model was left out alone, and each time f was gone. None of them can go."),
            Answer(
                "What is left is the smallest world that shows f.",
                False,
                "Nobody tried all smaller worlds: only that no single model can go is known.",
                "smallest",
            ),
            Answer(
                "The search has failed.", False, "It has ended: it found models of which no single one can go.", "stuck"
            ),
        )
    return (
        Answer(lacks, True, "Smaller parts come next: leaving one out takes away less."),
        Answer("f needs all models of E.", False, "It needs something in each of them, but perhaps not much.", "fewer"),
        Answer("The search has failed.", False, "It goes on: the next round has smaller parts.", "stuck"),
    )


def _turned(answers: tuple[Answer, ...], by: int) -> tuple[Answer, ...]:
    """In another order each time: the right answer has no place of its own."""
    by %= len(answers)
    return answers[by:] + answers[:by]
