"""Any number of things: read or refused, and soon."""

import pytest

from tests.tiers import slow
from tests.world.hostile import (
    LINK,
    MODEL,
    attached,
    check_bounded,
    ends,
    frame,
    joint,
    links,
    model,
    read_or_refused,
    shape,
    world,
)

COUNT = 100_000


def row() -> str:
    return "".join(attached(f"f{number}", f"f{number + 1}") for number in range(COUNT)) + attached(
        f"f{COUNT}", "l0"
    )


# Texts are made when they are asked for: some are large.
MANY = {
    "models inside models": lambda: "<model name='m'>" * 5000 + "</model>" * 5000,
    "any elements inside each other": lambda: "<a>" * 200_000 + "</a>" * 200_000,
    "frames in a row": lambda: model(
        LINK
        + "".join(frame(f"f{i}", f"f{i + 1}") for i in range(2000))
        + frame("f2000", "l")
        + "<link name='k'>"
        "<pose relative_to='f0'/></link>"
    ),
    "frames attached in a row": lambda: model(links(2) + row() + joint(ends("l1", "f0"), "fixed")),
    "links in a row": lambda: model(
        links(3000)
        + "".join(joint(ends(f"l{i}", f"l{i + 1}"), "fixed", f"j{i}") for i in range(2999))
    ),
    "links on one": lambda: model(
        links(3000) + "".join(joint(ends("l0", f"l{i + 1}"), "fixed", f"j{i}") for i in range(2999))
    ),
    "attributes": lambda: world(
        "<model name='m'" + "".join(f" a{i}='0'" for i in range(100_000)) + f">{LINK}</model>"
    ),
    "blanks in a tag": lambda: world(f"<model name='m'{' ' * 20_000_000}>{LINK}</model>"),
    "an attribute": lambda: world(f"<model name='m' a='{'&gt;' * 1_000_000}'>{LINK}</model>"),
    "names": lambda: model(LINK, "m" * 2_000_000),
    "models of one name": lambda: world(MODEL * 5000),
    "models of one name in the state": lambda: world(
        MODEL * 2000
        + "<state>"
        + "<model name='m'><pose>0 0 1 0 0 0</pose></model>" * 5000
        + "</state>"
    ),
    "elements that nobody knows": lambda: world(MODEL + "<what/>" * 50_000),
    "numbers": lambda: world(f"<model name='m'><pose>{'0 ' * 2_000_000}</pose>{LINK}</model>"),
    "digits": lambda: world(
        f"<model name='m'><pose>{'9' * 2_000_000} 0 0 0 0 0</pose>{LINK}</model>"
    ),
    "points of a polyline": lambda: shape(
        "<polyline>"
        + "".join(f"<point>{i} {i * i % 997}</point>" for i in range(50_000))
        + "</polyline>"
    ),
    "comments": lambda: world(MODEL + "<!-- -->" * 200_000),
    "namesakes of a frame that is nowhere": lambda: world(
        "".join(frame(f"frame number {number}", "") for number in range(5000))
        + f"<model name='m'><pose relative_to='frame number'/>{LINK}</model>"
    ),
    "namesakes that are long": lambda: world(
        frame("".join(chr(0x4E00 + i * i % 20_000) for i in range(60_000)), "")
        + (
            "<model name='m'><pose "
            f"relative_to='{''.join(chr(0x4E00 + i * i % 19_997) for i in range(60_000))}'/>"
        )
        + f"{LINK}</model>"
    ),
}


# Of these much is printed.
LONG = (
    "names",
    "models of one name",
    "models of one name in the state",
    "frames attached in a row",
    "links on one",
)
CASES = [(name,) for name in MANY] + [(name, "--json") for name in LONG]


@pytest.mark.parametrize(
    "words", slow(pytest.mark.fuzz, CASES, but=[("frames in a row",)]), ids=" ".join
)
def test_any_number_of_things_is_read_or_refused_soon(tmp_path, words):
    name, *options = words
    path = tmp_path / "hostile.world"
    text = MANY[name]()
    path.write_bytes(text if isinstance(text, bytes) else world(text))
    read_or_refused(check_bounded(path, *options), path)
