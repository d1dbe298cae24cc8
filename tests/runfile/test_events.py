"""Events come back from a file as they were written; what is missing, unknown or out of range in
one is named in one line.
"""

import json
from dataclasses import MISSING, fields

import pytest

from ddenv.errors import UserError
from ddenv.runfile.events import KINDS, NAMES
from ddenv.runfile.fold import _HANDLERS, apply
from ddenv.runfile.reading import plain
from ddenv.runfile.state import RunState
from ddenv.runfile.store import recorded
from tests.shorthand import raw
from tests.workbench import fake_moments, fake_run

SCENES = (
    fake_moments.sliced,
    fake_moments.waiting,
    fake_moments.guided,
    fake_moments.finished,
    fake_moments.isolated,
    fake_moments.piled,
)
# None of these is ever sound in a place of numbers.
NONSENSE = (-1, 1e16, float("nan"), float("inf"), 10**30, True, "1", [1], {})


def as_read(kind: str, data: object):
    return recorded(7, 1.0, kind, json.dumps(data)).event


def complaint(kind: str, data: object) -> str:
    with pytest.raises(UserError) as caught:
        as_read(kind, data)
    return str(caught.value)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """An event of each kind that these scenes have."""
    found = {}
    for number, scene in enumerate(SCENES):
        run = scene(fake_run.FakeRun(tmp_path_factory.mktemp("scenes") / f"{number}.ddenv"))
        for one in run.file.events():
            found.setdefault(one.kind, one.event)
        run.close()
    assert len(found) > 25
    return found


def test_every_event_comes_back_as_it_was_written(written):
    for kind, event in written.items():
        again = as_read(kind, plain(event))
        assert again == event
        # Also what does not count in a comparison.
        assert plain(again) == plain(event)


def test_kinds_are_in_a_file_what_they_are_called_here():
    assert len(KINDS) == len(NAMES) > 50
    assert KINDS["candidate_judged"].__name__ == "CandidateJudged"
    assert all(name == name.lower() and name.isidentifier() for name in KINDS)


def test_every_event_has_a_function_that_says_what_it_changes():
    assert set(_HANDLERS) == set(NAMES)


def test_a_field_that_is_missing_is_named(written):
    for kind, event in written.items():
        data = plain(event)
        for field in fields(event):
            if field.default is MISSING:
                less = {name: value for name, value in data.items() if name != field.name}
                assert (
                    complaint(kind, less)
                    == f"damaged run file: event 7 ({kind}): {field.name}: is missing"
                )


def test_a_field_that_nobody_knows_is_named(written):
    for kind, event in written.items():
        wrong = complaint(kind, plain(event) | {"nob\x1bdy": 1})
        assert (
            wrong == f"damaged run file: event 7 ({kind}): 'nob\\x1bdy': is not one of its fields"
        )


def test_a_number_that_cannot_be_is_named(written):
    checked = 0
    for kind, event in written.items():
        for field in fields(event):
            data = plain(event)
            if type(data.get(field.name)) not in (int, float):
                continue
            # A negative process is nonsense to nobody who reads it.
            for value in NONSENSE[field.name in ("pid", "seconds") :]:
                wrong = complaint(kind, data | {field.name: value})
                assert wrong.startswith(
                    f"damaged run file: event 7 ({kind}): {field.name}: should be"
                ), wrong
                assert ", found " in wrong and wrong.isprintable() and len(wrong) < 160
                checked += 1
    assert checked > 300


@pytest.mark.parametrize(
    ("kind", "data", "named"),
    [
        (
            "test_started",
            {"phase": "nap"},
            "phase: should be 'baseline', 'round', 'hand', 'audit', 'certify' or 'isolate'",
        ),
        ("round_started", {"candidates": [["partition", 0]]}, "candidates: 0: 2: is missing"),
        (
            "round_started",
            {"candidates": [["part", 0, None]]},
            "candidates: 0: 0: should be 'partition' or 'complement'",
        ),
        ("environment_named", {"models": "xyz"}, "models: should be hexadecimal digits"),
        (
            "baseline_finished",
            {"judged": {"outcomes": {"x": "pass"}}},
            "judged: outcomes: x: '[key]': should be a",
        ),
        ("baseline_finished", {"rate": 1.5}, "rate: should be less than or equal to 1, found 1.5"),
        (
            "certificate_finished",
            {"claims": [{"without": 0}]},
            "claims: 0: environment: is missing",
        ),
        ("finished", {"minimal": 1}, "minimal: should be a valid boolean, found 1"),
        ("finished", {"reason": ["[" * 500]}, "reason: should be a valid string, found ["),
        ("engine_started", {"command": -1}, "command: should be a whole number"),
    ],
)
def test_what_is_wrong_is_said_with_what_was_expected(written, kind, data, named):
    assert f"event 7 ({kind}): {named}" in complaint(kind, plain(written[kind]) | data)


def test_what_is_no_json_and_what_is_no_kind_is_told():
    assert complaint("nap", {}) == "damaged run file: event 7: is of an unknown kind 'nap'"
    assert complaint("paused", [1]) == "damaged run file: entry 7 is not a JSON object"
    nested = '{"reason": ' + "[" * 900 + "]" * 900 + ', "minimal": true}'
    with pytest.raises(UserError, match="damaged run file"):
        recorded(7, 1.0, "finished", nested)


def test_all_before_a_damaged_event_is_read(tmp_path):
    run = fake_run.FakeRun(tmp_path / "a.ddenv").created().baseline()
    before = run.state
    raw(run.file, "paused", {"x": 1})
    run.write("resumed")
    state = RunState()
    with pytest.raises(UserError, match=r"\(paused\): x: is not one of its fields"):
        for one in run.file.read():
            state = apply(state, one)
    assert state == before
    with pytest.raises(UserError, match="is not one of its fields"):
        run.file.events()
    run.close()
