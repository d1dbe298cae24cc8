"""Our reader of XML: what a strict parser reads it reads alike, what TinyXML2 lets through too, and
nothing breaks it.
"""

import os
import re
from pathlib import Path
from xml.parsers import expat

import pytest
from hypothesis import example, given, seed
from hypothesis import strategies as st

from ddenv.errors import UserError
from ddenv.world.sdf.read import parse_world
from ddenv.world.sdf.xml import parse
from ddenv.world.tinyxml import NotXml, parse_xml, strict_fault
from ddenv.world.write import without
from tests.conftest import DATA
from tests.tiers import slow
from tests.world.hostile import LINK, MODEL, model, world

FILE = Path("made.sdf")
TAG = re.compile(rb"""(?:[^'">]|"[^"]*"|'[^']*')*>""")
BATCHES = slow(
    pytest.mark.fuzz, range(int(os.environ.get("DDENV_HOSTILE_BATCHES", "8"))), but=[0, 1]
)


def by_expat(text):
    """Tag, attributes, text before the first child, line and byte range of each element, in the
    file's order; None if refused.
    """
    parser, found, open_elements = expat.ParserCreate(), [], []
    parser.buffer_text = True

    def start(tag, attributes):
        entry = {
            "tag": tag,
            "attributes": attributes,
            "text": None,
            "line": parser.CurrentLineNumber,
        }
        entry |= {"start": parser.CurrentByteIndex, "depth": len(open_elements), "children": 0}
        if open_elements:
            open_elements[-1]["children"] += 1
        found.append(entry)
        open_elements.append(entry)

    def end(tag):
        entry = open_elements.pop()
        # Of `<a/>` expat may give the start or the end.
        empty = TAG.match(text, entry["start"])
        entry["end"] = (
            empty.end()
            if empty[0].endswith(b"/>")
            else text.index(b">", parser.CurrentByteIndex) + 1
        )

    def words(data):
        innermost = open_elements[-1]
        if not innermost["children"]:
            innermost["text"] = (innermost["text"] or "") + data

    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = (
        start,
        end,
        words,
    )
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, LookupError, ValueError):
        return None
    return found


def check_as_expat(text):
    expected = by_expat(text)
    if expected is None:
        return
    root = parse_xml(text, FILE)
    found = list(root.iter())
    assert len(found) == len(expected)
    for element, entry in zip(found, expected, strict=True):
        assert (element.tag, dict(element.attrib), element.text) == (
            entry["tag"],
            entry["attributes"],
            entry["text"],
        )
        assert (element.start, element.end) == (entry["start"], entry["end"])
        # A CR alone ends a line for expat, but not for TinyXML2.
        assert b"\r" in text.replace(b"\r\n", b"") or element.line == entry["line"]
        assert sum(1 for _ in parents(element)) == entry["depth"]


def parents(element):
    while element.parent is not None:
        element = element.parent
        yield element


NAMES = st.sampled_from(["a", "b", "gz:c", "d.e-f_1", "Бочка", "sdf"])
WORDS = st.sampled_from(
    [
        "",
        " ",
        "x",
        "1 2\n3",
        "\t&amp;\r\n",
        "&lt;&#65;&#x42;",
        "&#10;",
        "é€😀",
        "]] >",
        "'",
        "a\rb",
        ">",
        "&#13;",
        "&apos;",
    ]
)
ATTRIBUTES = st.dictionaries(NAMES, st.tuples(st.sampled_from("'\""), WORDS), max_size=3)
SPACES = st.sampled_from([" ", "\n", "\t ", "\r\n"])
BESIDE = st.sampled_from(
    ["", "<!-- a - b -->", "<?php x?>", "<!--<b>-->", "<![CDATA[<x>&amp;\r\n]]>"]
)


@st.composite
def elements(draw, depth=0):
    """The text of an element that strict XML allows."""
    name, space = draw(NAMES), draw(SPACES)
    given = draw(ATTRIBUTES)
    equals = draw(st.sampled_from(["=", " = "]))
    inner = "".join(
        f"{space}{key}{equals}{quote}{words.replace(quote, '')}{quote}"
        for key, (quote, words) in given.items()
    )
    count = draw(st.integers(0, 3)) if depth < 3 else 0
    inside = "".join(
        draw(WORDS) + draw(BESIDE) + draw(elements(depth + 1)) + draw(WORDS) for _ in range(count)
    )
    inside = inside or draw(WORDS) + draw(BESIDE) + draw(WORDS)
    if not inside:
        return f"<{name}{inner}/>"
    return f"<{name}{inner}{draw(st.sampled_from(['', ' ']))}>{inside}</{name}{draw(st.sampled_from(['', ' ']))}>"


BEFORE = st.sampled_from(
    [
        "",
        "<?xml version='1.0'?>",
        "<?xml version='1.0' encoding='utf-8'?>\n<!-- c -->",
        "\n",
        "<!---->",
    ]
)


@given(text=elements(), before=BEFORE, after=st.sampled_from(["", "\n", "<!-- end -->", "<?x?>\n"]))
def test_what_a_strict_parser_reads_is_read_alike(text, before, after):
    document = f"{before}{text}{after}".encode()
    check_as_expat(document)


@pytest.mark.parametrize(
    "path", sorted(DATA.rglob("*.world")) + sorted(DATA.rglob("*.sdf")), ids=lambda path: path.name
)
def test_our_own_files_are_read_as_a_strict_parser_reads_them(path):
    assert strict_fault(path.read_bytes()) is None
    check_as_expat(path.read_bytes())


# What TinyXML2 lets through: before the world, in it, after it.
TOLERATED = {
    "dashes in a comment": ("<!-- a -- b --->", "", ""),
    "a prefix without a declaration": ("", "<gz:policies gz:x='1'/>", ""),
    "a blank line before the declaration": ("\n <?xml version='1.0'?>", "", ""),
    "a declaration of an encoding that it has not": (
        "<?xml version='1.0' encoding='UTF-16'?>",
        "",
        "",
    ),
    "a bare ampersand": ("", "<plugin name='p' filename='a&b'>x & y &nbsp; &#xZ;</plugin>", ""),
    "a less-than sign in an attribute": ("", "<plugin name='a<b' filename='f'/>", ""),
    "the end of CDATA in a text": ("", "<plugin name='p' filename='f'>]]></plugin>", ""),
    "attributes that touch": ("", "<plugin name='p'filename='f'/>", ""),
    "blanks after <": ("", "< plugin name='p' filename='f'>< /plugin>", ""),
    "attributes of an end tag": ("", "<plugin name='p' filename='f'></plugin name='p'>", ""),
    "an unknown markup": ("", "<!x y>", ""),
    "bytes in a comment that are not UTF-8": ("<!-- \udce4 -->", "", ""),
    "a stray character": ("x", "", ""),
    "an element before the root": ("<a/>", "", ""),
    "a second root": ("", "", world(MODEL).decode()),
    "text after the root": ("", "", "more<!-- -->"),
    "an end tag too much": ("", "", "</sdf> and <what> follows"),
}


@pytest.mark.parametrize("case", TOLERATED)
def test_what_tinyxml2_lets_through_is_read_with_one_note_and_written_byte_by_byte(case):
    before, inside, after = TOLERATED[case]
    other = f"<model name='other'>{LINK}</model>"
    text = world(MODEL + inside + other).decode()
    whole = f"{before}{text}{after}".encode("utf-8", "surrogateescape")
    read = parse_world(whole, FILE)
    assert [each.name for each in read.models] == ["m", "other"]
    (note,) = (note for note in read.notes if note.what == "a fault of XML")
    assert "in made.sdf, line " in note.why and "column " in note.why
    smaller = without(read, frozenset(["other"]))
    assert smaller == whole.replace(other.encode(), b"", 1)
    assert [each.name for each in parse_world(smaller, FILE).models] == ["m"]


def test_a_stray_character_is_shown_where_it_is():
    read = parse_world("\n é ".encode() + world(MODEL), FILE)
    assert "line 2, column 2: text before the first element" in read.notes[0].why


# What is said, of which text; the column is that of the fault.
REFUSED = {
    ":2:3: not well-formed XML: </a> closes <b> of line 1": "<a><b>\n  </a>",
    ":1:4: not well-formed XML: <b> has no end tag": "<a><b>",
    ":1:4: not well-formed XML: attribute 'b' in <a> has no quotes around its value": "<a b=1/>",
    ":1:4: not well-formed XML: attribute 'b' in <a> has no value": "<a b/>",
    ":1:4: not well-formed XML: attribute 'b' in <a> has no closing quote": "<a b='1/>",
    ":1:10: not well-formed XML: attribute 'b' is given twice in <a>": "<a b='1' b='1'/>",
    ":1:1: not well-formed XML: the tag <a is not closed by '>'": "<a ",
    ":1:4: not well-formed XML: expected an attribute or '>' in the tag <a": "<a =/>",
    ":1:6: not well-formed XML: a '<' that begins no tag; write &lt; for the character": "<a>é < 3</a>",
    ":1:4: not well-formed XML: a comment is not closed by '-->'": "<a><!-->",
    ":1:4: not well-formed XML: a CDATA section is not closed by ']]>'": "<a><![CDATA[x</a>",
    ":1:1: not well-formed XML: what begins with '<?' is not closed by '?>'": "<?xml",
    ":1:8: not well-formed XML: the declaration <?xml ...?> must come first": "<!----><?xml version='1.0'?><a/>",
    ":1:4: not well-formed XML: </a/> is both an end tag and an empty element": "<a></a/>",
    ":1:5: not well-formed XML: text after the last element": "<a/>x",
    ":1:5: not well-formed XML: &#0; is no character": "<a>x&#0;</a>",
    ":1:4: not well-formed XML: a control character (byte 0x1b)": "<a>\x1b</a>",
    ":1:5: not well-formed XML: no element found": "text",
    ":2:1: DOCTYPE is not allowed": "\n<!doctype a><a/>",
}


@pytest.mark.parametrize("said", REFUSED)
def test_what_tinyxml2_refuses_is_refused_with_line_and_column(said):
    with pytest.raises(UserError) as refused:
        parse(REFUSED[said].encode(), FILE)
    assert str(refused.value).startswith(f"{FILE}{said}")


@pytest.mark.parametrize(
    "text",
    [
        b"<a>" + b"x<!---->" * 200_000 + b"</a>",
        b"<a>" + b"&#1" * 200_000 + b"</a>",
        b"<a " + b"b " * 200_000,
        b"<a b" + b" " * 400_000,
        b"<a>" + b"<!x" * 200_000,
        b"<" * 400_000,
        b"<?xml " + b"encoding " * 100_000 + b"?><a/>",
        b"<a " + b"".join(b"b%d='%d'" % (number, number) for number in range(50_000)) + b"/>",
        b"<a>&#" + b"9" * 400_000 + b";</a>",
        b"<a>" * 100_000,
        b"<a/>" * 100_000,
        b"&" * 400_000 + b"<a/>",
    ],
    ids=range(12),
)
def test_time_grows_with_the_size_and_not_with_its_square(text):
    """No measure of time: a square of these sizes would not come to an end."""
    try:
        parse_xml(text, FILE)
    except NotXml:
        return


PIECES = st.sampled_from(
    [
        *(
            b"< > / a b = ' \" & # x ; 1 ! - -- [CDATA[ ]]> ? ?> <!-- --> : <a> </a> &amp; "
            b"utf-16 cp1252 '?> \xff \xc3\xa9"
        ).split(),
        *(
            b" ",
            b"\n",
            b"\r",
            b"\0",
            b"\x1b",
            b"<a b='1'/>",
            b"<?xml version='1.0' encoding='",
            b"<!DOCTYPE ",
            b"\xef\xbb\xbf",
        ),
    ]
)


@pytest.mark.parametrize("batch", BATCHES)
def test_nothing_but_a_refusal_in_one_line_comes_of_any_text(batch):
    @seed(batch)
    @given(pieces=st.lists(PIECES, max_size=40), inside=st.binary(max_size=4))
    @example(pieces=[b"<?xml encoding='undefined'?><a/>"], inside=b"")
    def check(pieces, inside):
        for text in (
            b"".join(pieces),
            model(LINK) + b"".join(pieces),
            b"<a>" + b"".join(pieces) + inside + b"</a>",
        ):
            try:
                root = parse(text, FILE)
            except UserError as error:
                assert str(error).isprintable() and str(error).startswith(str(FILE))
            else:
                for element in root.iter():
                    assert (
                        text.startswith(b"<", element.start)
                        and text[element.end - 1 : element.end] == b">"
                    )
                strict_fault(text)
                check_as_expat(text)

    check()
