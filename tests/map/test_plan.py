"""In which order and colour models are drawn."""

import pytest

from ddenv.map.footprints import DYNAMIC, STATIC, plan
from tests.map.worlds import GROUND, box, world_of


def drawn(*models: str):
    return plan(world_of(GROUND, *models))


def test_what_lies_on_top_is_drawn_later():
    names = [each.model.name for each in drawn(box("lid", 0, 0, z=2), box("crate", 0, 0), box("shelf", 0, 0, z=1))]
    assert names == ["crate", "shelf", "lid"]


def test_of_models_of_one_height_the_larger_is_drawn_first():
    small, large = box("small", 0, 0), box("large", 0, 0, size=(2, 2, 0.3))
    assert [each.model.name for each in drawn(small, large)] == ["large", "small"]


def test_a_huge_model_hides_nothing_wherever_it_is():
    crates = [box(f"crate {number}", number, 0) for number in range(5)]
    first, *others = drawn(*crates, box("roof", 0, 0, size=(20, 20, 0.1), z=4))
    assert first.model.name == "roof"
    assert first.floor
    assert not any(each.floor for each in others)


def test_of_few_models_none_is_a_floor():
    assert not any(each.floor for each in drawn(box("hall", 0, 0, size=(50, 50, 1)), box("crate", 0, 0)))


def test_colours_are_those_of_the_file_or_else_of_the_kind():
    glass = box("glass", 2, 0, color="0 0 1 1").replace("<material>", "<transparency>1</transparency><material>")
    models = [box("red", 0, 0, color="1 0 0 1"), glass, box("moves", 4, 0, static=False)]
    assert {each.model.name: each.color for each in drawn(*models)} == {
        "red": (255, 0, 0),
        "glass": STATIC,
        "moves": DYNAMIC,
    }


def test_shades_tell_low_from_high():
    shades = {each.model.name: each.shade for each in drawn(*(box(f"{z}", z, 0, z=z) for z in (0, 1, 2)))}
    assert shades == pytest.approx({"0": 0, "1": 0.5, "2": 1})
    assert [each.shade for each in drawn(box("a", 0, 0), box("b", 2, 0))] == [1, 1]


def test_nothing_is_drawn_of_an_empty_world():
    assert drawn() == ()
