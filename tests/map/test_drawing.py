"""Numbers and names fit for a map."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.map.drawing import tick_step, tick_text, ticks
from ddenv.text import padded, shortened, told_apart, width


@given(st.text(max_size=60), st.integers(0, 40))
def test_a_name_fits_and_steers_nothing(name, columns):
    short = shortened(name, columns)
    assert width(short) <= columns
    assert short.isprintable()
    assert width(padded(short, columns)) == columns


def test_copies_of_a_model_stay_apart():
    assert shortened("frc2016_roughterrain_clone_12", 13) == "frc201…one_12"
    assert shortened("crate", 5) == "crate"


@given(
    st.lists(st.text("ab_", min_size=1, max_size=12), unique=True, max_size=6), st.integers(6, 12)
)
def test_names_that_are_cut_are_told_apart_wherever_one_place_of_the_cut_does_that(names, columns):
    cut = told_apart(tuple(names), columns)
    assert all(width(text) <= columns for text in cut.values())
    apart = [
        len({shortened(name, columns, head) for name in names}) == len(names)
        for head in (None, *range(columns))
    ]
    assert (len(set(cut.values())) == len(names)) == any(apart)


def test_copies_of_gazebo_are_told_apart():
    copies = ("lumber_2x4x48_clone_3_clone_0_clone_0", "lumber_2x4x48_clone_1_clone_0_clone_0")
    assert len({shortened(name, 18) for name in copies}) == 1
    assert set(told_apart(copies, 18).values()) == {"…3_clone_0_clone_0", "…1_clone_0_clone_0"}


def test_wide_characters_take_two_columns():
    assert width("日本") == 4
    assert shortened("日本語の名前", 7) == "日本…前"


@given(st.floats(0.001, 1e6), st.integers(1, 40))
def test_a_step_is_round_and_not_too_small(span, most):
    step = tick_step(span, most)
    assert f"{step:e}"[0] in "125"
    assert len(ticks(0, span, step)) - 1 <= most
    assert tick_step(span, most) <= 2.5 * span / most * (1 + 1e-9)


@pytest.mark.parametrize(
    ("low", "high", "step", "texts"),
    [
        (-1, 1, 0.5, ["-1.0", "-0.5", "0.0", "0.5", "1.0"]),
        (3, 21, 5, ["5", "10", "15", "20"]),
        (0.1, 0.3, 1, []),
    ],
)
def test_numbers_along_an_axis(low, high, step, texts):
    assert [tick_text(value, step) for value in ticks(low, high, step)] == texts


@pytest.mark.parametrize("span", [0.0, float("inf"), float("nan")])
def test_a_span_that_is_none_has_a_step_too(span):
    assert tick_step(span, 5) == 1
