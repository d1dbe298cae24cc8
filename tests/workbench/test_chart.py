"""The chart of models by test, as text."""

import pytest

from ddenv.runfile.progress import Point
from ddenv.workbench.run.models import DECIDED, NEEDED, Course, steps

FALLING = Course((Point(0, 40), Point(10, 20), Point(20, 5)), 20)
GUIDED = Course((Point(0, 40), Point(10, 20, 11), Point(20, 14, 11)), 24, 11, (3, 20))


def lines(course, width, height):
    return steps(course, width, height).plain.split("\n")


def test_steps_fall_with_the_environment():
    text = lines(FALLING, 46, 9)
    assert len(text) == 9
    assert text[0].startswith("40┤█")
    assert text[-1].strip().startswith("0")
    assert text[-1].endswith("20 tests")
    heights = [sum(line[column] != " " for line in text[:-2]) for column in range(3, 45)]
    assert heights == sorted(heights, reverse=True)
    assert (heights[0], heights[-1]) == (7, 1)


@pytest.mark.parametrize("size", [(5, 2), (0, 0), (12, 3), (20, 5), (46, 9), (150, 20)])
@pytest.mark.parametrize("course", [Course(), Course((Point(0, 0),)), FALLING, GUIDED])
def test_a_chart_fits_into_its_place(course, size):
    text = lines(course, *size)
    assert text == [""] or len(text) == size[1]
    assert all(len(line) <= size[0] for line in text)


def test_what_is_known_to_be_needed_is_a_line_with_a_label():
    text = lines(GUIDED, 60, 12)
    row = next(line for line in text if line.startswith("11"))
    # It is known from the second point on, and is not told by its colour.
    assert 20 < row.index(NEEDED) < 36
    assert "at least 11 needed" in text[-1]
    assert lines(FALLING, 60, 12) == [line.replace(NEEDED, "█") for line in lines(FALLING, 60, 12)]


def test_what_the_user_decided_is_marked_on_the_axis():
    *_, rule, _ = lines(GUIDED, 60, 12)
    assert [place - 3 for place, char in enumerate(rule) if char == DECIDED] == [
        round(3 * 55 / 24),
        round(20 * 55 / 24),
    ]
    *_, rule, _ = lines(GUIDED, 20, 5)
    assert rule.count(DECIDED) == 2


def test_models_come_back_when_a_reduction_is_taken_back():
    text = lines(Course((Point(0, 10), Point(5, 2), Point(10, 10)), 15), 40, 9)
    assert text[0][4] == text[0][-1] == "█"
    assert text[0][20] == " "
