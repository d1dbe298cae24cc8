"""Names and URIs that mean harm: none leads out of its folder, none steers the terminal."""

import re
from pathlib import Path

import pytest

from tests.tiers import slow
from tests.world.hostile import (
    LINK,
    check_bounded,
    frame,
    include,
    model,
    read_or_refused,
    refusal,
    shape,
    world,
)

HARMFUL = r"""
../../../../../../etc/passwd a/../../../../../../../etc/passwd %2e%2e/%2e%2e/%2e%2e/etc/passwd ..%2f..%2f..%2f..%2fetc/passwd
file://../../../etc/passwd file:///etc/passwd file:///dev/zero /dev/zero /dev/tty /proc/self/mem model://../../etc/passwd
model://a/../../../etc model://%2e%2e/%2e%2e/etc/passwd package://../x http://localhost:1/model.sdf
https://fuel.gazebosim.org/1.0/../models/../../x https://fuel.gazebosim.org/1.0/o/models/m/1/files/../../../../x
ftp://localhost/x javascript:alert(1) model:// file:// .. . / ~ ~nobody/x %00 a%00b %ff%fe \\server\share C:\Windows\win.ini
hostile.world ./hostile.world x/../hostile.world &#x9b;31mred one&#10;two 🦊
"""
URIS = [*HARMFUL.split(), "a" * 5000, "a/" * 5000]


@pytest.mark.parametrize("uri", URIS, ids=lambda uri: uri[:40])
def test_a_uri_that_leads_to_no_model_is_refused(check, uri):
    said, path = check(world(include(uri)))
    # The complaint may be about what is wrong inside a file that was found.
    inner = re.match(r"ddenv: (/[^:]*)", said.stderr)
    place = path if inner is None or inner[1] == str(path) else Path(inner[1])
    assert len(refusal(said, place)) < 5000
    assert "root:" not in said.stderr


@pytest.mark.parametrize("uri", URIS, ids=lambda uri: uri[:40])
def test_a_mesh_uri_that_leads_to_no_mesh_is_refused_where_it_stands(check, uri):
    line = refusal(*check(shape(f"<mesh><uri>{uri}</uri></mesh>")))
    assert re.match(r":1: /sdf/world/\S+/geometry/mesh: ", line) and len(line) < 5000, line


NAMES = (
    "world",
    "__model__",
    "__root__",
    "a::b",
    "::",
    "::a",
    "a::",
    "x #2",
    "/",
    "'",
    "]",
    "\u202e",
    "\ufeff",
    "木" * 2000,
)
RUDE = ("&#10;", "a&#13;b", "a&#9;b", "a&#x9b;31m", "&#x2028;", "&#x85;")


@pytest.mark.parametrize("name", NAMES + RUDE, ids=lambda name: ascii(name)[:20])
@pytest.mark.parametrize("json", [(), ("--json",)], ids=["table", "json"])
def test_a_strange_name_is_read_or_refused_and_never_steers_the_terminal(check, name, json):
    text = f'<sdf version="1.9"><world name="w"><model name="{name}">{LINK}</model></world></sdf>'
    read_or_refused(*check(text.encode(), *json))


@pytest.mark.parametrize("name", RUDE)
@pytest.mark.parametrize(
    "wrong", ["<pose>{}</pose>", "<frame name='{}'/><frame name='x' attached_to='{}'/>"]
)
def test_what_a_complaint_quotes_never_steers_the_terminal(check, name, wrong):
    use = "<model name='u'><pose relative_to='x{}'/></model>"
    refusal(
        *check(
            world(
                (wrong + use).replace("{}", name)
                + f"<model name='{name}'>{LINK}<pose>{name} x</pose></model>"
            )
        )
    )


def test_a_complaint_stays_readable_however_long_the_names_are(check):
    name = "n" * 100_000
    assert (
        len(
            refusal(
                *check(
                    model(
                        LINK
                        + frame(name, name)
                        + f"<link name='k'><pose relative_to='{name}'/></link>"
                    )
                )
            )
        )
        < 5000
    )


@pytest.mark.parametrize("encoding", slow(pytest.mark.fuzz, ["ascii", "latin-1"], but=["ascii"]))
@pytest.mark.parametrize("wrong", [False, True])
def test_a_terminal_without_unicode_gets_what_it_can_show(tmp_path, encoding, wrong):
    path = tmp_path / "hostile.world"
    path.write_bytes(model(LINK + ("<pose>nan</pose>" if wrong else ""), "木 Bäume"))
    said = check_bounded(path, PYTHONIOENCODING=encoding)
    assert "Traceback" not in said.stderr, said.stderr[-2000:]
    assert said.returncode == (2 if wrong else 0)
