"""The SVG of a world: whole, safe, and telling."""

import itertools
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from ddenv.map.drawing import place_labels
from ddenv.map.svg import MOST_LABELS, svg_map
from tests.map.worlds import GROUND, box, world_of

SVG = "{http://www.w3.org/2000/svg}"
NASTY = "<b>&amp;\"' [bold] ]]> \u202e x"


def tree_of(*models: str, file: str = "w.sdf", **marks):
    return ElementTree.fromstring(svg_map(world_of(*models, file=file), **marks))


def tooltips(tree) -> list[str]:
    parts = (part for part in tree.iter() if part is not tree)
    return [part.findtext(f"{SVG}title") for part in parts if part.find(f"{SVG}title") is not None]


def words(tree) -> list[str]:
    return [text.text for text in tree.iter(f"{SVG}text")]


def test_every_model_but_the_ground_has_a_shape_with_its_name_size_and_pose():
    tree = tree_of(
        GROUND, box("crate", 1, 2, 0.5, size=(1, 1, 0.4)), box("post", 3, 0, static=False)
    )
    crate, post = sorted(tooltips(tree))
    assert crate.splitlines() == [
        "crate",
        "static, 1.36 x 1.36 x 0.40 m",
        "pose 1.00, 2.00, 0.20 m, yaw 0.50 rad, top at 0.40 m",
    ]
    assert post.startswith("post\ndynamic")


def test_the_head_names_the_file_and_counts():
    told = words(tree_of(GROUND, box("a", 0, 0), box("b", 3, 0, static=False), file="dir/my.sdf"))
    assert "my.sdf" in told
    assert "2 models, without the ground" in told
    assert {"x, m", "y, m"} <= set(told)


def test_only_what_can_move_is_dashed():
    tree = tree_of(box("a", 0, 0), box("b", 3, 0, static=False))
    dashed = [path for path in tree.iter(f"{SVG}path") if "dynamic" in path.get("class").split()]
    assert [path.findtext(f"{SVG}title").splitlines()[0] for path in dashed] == ["b"]


def test_names_are_text_and_nothing_else():
    tree = tree_of(box(NASTY, 0, 0, size=(9, 2, 1)), file="<i>&.sdf")
    assert tooltips(tree)[0].startswith("<b>&amp;\"' [bold] ]]> \N{REPLACEMENT CHARACTER} x\n")
    assert "<i>&.sdf" in words(tree)
    assert {element.tag for element in tree.iter()} <= {
        SVG + tag for tag in ("svg", "style", "title", "rect", "g", "path", "text", "clipPath")
    }


def test_start_and_goal_are_marked():
    tree = tree_of(box("a", 0, 0), spawn=(-2.0, 0.0, 1.0), goal=(20.0, 3.0))
    assert {"S", "G"} <= set(words(tree))
    assert "start (-2, 0) m, yaw 1 rad" in tooltips(tree)
    assert "goal (20, 3) m" in tooltips(tree)
    assert not {"S", "G"} & set(words(tree_of(box("a", 0, 0))))


def test_a_mark_that_is_far_away_is_on_the_map():
    tree = tree_of(box("a", 0, 0), goal=(50.0, -30.0))
    (mark,) = [
        group for group in tree.iter(f"{SVG}g") if "goal" in (group.findtext(f"{SVG}title") or "")
    ]
    x, y = map(float, mark.get("transform")[len("translate(") : -1].split())
    assert 0 < x < float(tree.get("width"))
    assert 0 < y < float(tree.get("height"))


@pytest.mark.parametrize("count", [0, 1, 1000])
def test_any_number_of_models(count):
    tree = tree_of(*(box(f"m{number}", number % 40, number // 40) for number in range(count)))
    assert len(tooltips(tree)) == count
    assert sum(text.startswith("m") for text in words(tree)[1:]) <= MOST_LABELS


def test_a_model_without_shapes_is_seen():
    tree = tree_of('<model name="ghost"><link name="l"/></model>')
    assert tooltips(tree)[0].startswith("ghost\ndynamic, 0.00 x 0.00 x 0.00 m")
    assert "ghost" in words(tree)


def test_numbers_far_away_stay_small():
    text = svg_map(world_of(box("a", 0, 0), box("b", 1, 0), box("hall", 0, 0, size=(9e5, 9e5, 1))))
    assert max(len(word) for word in text.replace("L", " ").replace("M", " ").split()) < 100


def test_names_stand_on_no_other_name():
    frame = np.array([0.0, 0.0, 600.0, 400.0])
    places = [(10.0 + 40 * column, 10.0 + 30 * row) for row in range(12) for column in range(13)]
    boxes = np.array([(x, y, x + 30, y + 20) for x, y in places])
    names = {number: f"crate_{number}" for number in range(len(boxes))}
    placed = place_labels(names, boxes, np.zeros(len(boxes), dtype=bool), frame)
    assert len(placed) > 5
    for one, other in itertools.combinations(placed.values(), 2):
        assert (np.minimum(one[2:], other[2:]) <= np.maximum(one[:2], other[:2])).any()
    for one in placed.values():
        assert (one[:2] >= frame[:2]).all() and (one[2:] <= frame[2:]).all()


def test_a_name_stands_in_the_middle_of_a_large_model_and_beside_a_small_one():
    frame, boxes = (
        np.array([0.0, 0.0, 600.0, 400.0]),
        np.array([[100, 100, 300, 200], [400, 100, 410, 110]], dtype=float),
    )
    placed = place_labels({0: "platform", 1: "crate"}, boxes, np.zeros(2, dtype=bool), frame)
    assert ((placed[0][:2] + placed[0][2:]) / 2).tolist() == [200, 150]
    assert placed[1][0] == 410
