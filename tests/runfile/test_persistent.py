"""The persistent tuple: read like a tuple, and a changed one leaves the earlier one as it was."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.runfile.state import CHUNK, PersistentTuple

lengths = st.sampled_from([0, 1, 2, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK, 2 * CHUNK + 5])
ends = st.none() | st.integers(-3 * CHUNK, 3 * CHUNK)
steps = st.none() | st.integers(-CHUNK - 1, CHUNK + 1).filter(bool)


def numbers(length: int) -> PersistentTuple[int]:
    return PersistentTuple.of(range(length))


@given(lengths, ends, ends, steps)
def test_slices_are_those_of_a_tuple(length, start, stop, step):
    part = slice(start, stop, step)
    assert numbers(length)[part] == tuple(range(length))[part]


@given(lengths)
def test_it_is_read_like_a_tuple(length):
    plain, found = tuple(range(length)), numbers(length)
    assert (len(found), bool(found)) == (length, bool(plain))
    assert tuple(found) == plain
    assert tuple(reversed(found)) == plain[::-1]
    assert [found[index] for index in range(-length, length)] == [
        plain[index] for index in range(-length, length)
    ]
    for index in (length, -length - 1):
        with pytest.raises(IndexError):
            found[index]
        with pytest.raises(IndexError):
            found.changed(index, 0)


@given(lengths, st.lists(st.none() | st.integers(0, 3 * CHUNK), max_size=20))
def test_earlier_ones_stay_and_later_ones_have_the_change(length, places):
    """A place means another item there, None one more item."""
    found, plain, kept = numbers(length), list(range(length)), []
    for item, place in enumerate(places, start=1000):
        kept.append((found, tuple(plain)))
        if place is None or not plain:
            found, plain = found.added(item), [*plain, item]
        else:
            found = found.changed(place % len(plain), item)
            plain[place % len(plain)] = item
    for earlier, was in [*kept, (found, tuple(plain))]:
        assert tuple(earlier) == was
        assert earlier == PersistentTuple.of(was)
        assert hash(earlier) == hash(PersistentTuple.of(was))


def test_a_change_copies_one_chunk():
    before = numbers(10 * CHUNK)
    after = before.changed(3 * CHUNK + 1, -1)
    assert [one is other for one, other in zip(before.chunks, after.chunks, strict=True)].count(
        False
    ) == 1
    grown = before.added(-1)
    assert all(one is other for one, other in zip(before.chunks, grown.chunks, strict=False))


def test_what_changed_is_found_in_order():
    before = numbers(2 * CHUNK)
    after = before.changed(CHUNK + 2, -1).changed(5, -2).changed(6, 6).added(-3)
    assert list(after.changed_since(before)) == [-2, -1, -3]
    assert list(before.changed_since(after)) == [5, CHUNK + 2]
    assert list(after.changed_since(after)) == []
