"""What falls when others go, by which models rest on which."""

from hypothesis import given
from hypothesis import strategies as st

from ddenv.runfile.supports import dropped

NAMES = tuple("abcdefgh")
SOME = st.sets(st.sampled_from(NAMES))
PAIRS = st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=12).map(tuple)


def test_what_lies_on_a_shelf_falls_with_all_that_lies_on_it():
    supports = (("ball", "tray"), ("tray", "shelf"), ("tray", "wall"), ("cup", "table"))
    world = ("ball", "tray", "shelf", "wall", "cup", "table")
    assert dropped(supports, ("ball", "tray", "wall", "cup", "table"), world) == ("ball", "tray")
    assert dropped(supports, ("ball", "shelf"), world) == ("ball",)
    assert dropped(supports, ("shelf", "table"), world) == ()
    # Without the shelf the tray has fallen already; what is put back lies where it fell, too.
    assert dropped(supports, ("ball", "tray", "cup"), ("ball", "tray", "cup", "table")) == ("cup",)
    assert dropped(supports, ("ball", "tray", "wall"), ("ball", "wall")) == ("ball", "tray")


@given(PAIRS, SOME, SOME)
def test_something_falls_only_if_it_loses_something_that_it_rested_on(supports, keep, gone):
    kept, world = tuple(sorted(keep)), tuple(sorted(keep | gone))
    fallen = set(dropped(supports, kept, world))
    for name in kept:
        below = {lower for upper, lower in supports if upper == name}
        assert (name in fallen) == bool(below & (set(world) - keep) or below & fallen)
    assert dropped(supports, world, world) == ()
    # What is kept besides changes nothing for what has lost its hold directly.
    assert {
        upper for upper, lower in supports if upper in keep and lower in set(world) - keep
    } <= fallen
