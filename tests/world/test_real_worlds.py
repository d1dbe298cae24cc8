"""Two worlds that Gazebo saved, kept beside the checkout: read as Gazebo had them, and written as
they were.
"""

from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.model import Box
from ddenv.world.scenario import Reading
from ddenv.world.sdf.read import parse_world, read_world
from ddenv.world.write import without, write_converted
from tests.conftest import ROOT
from tests.tiers import examples
from tests.world.test_convert import assert_same_in_drake

WORLDS = ROOT.parent / "shared" / "worlds"
READINGS = {
    "frictionpatch6.world": Reading(stand_ins={"model://construction_barrel": "cylinder:0.3,1.0"}),
    "rough_terrain_gap.world": Reading(),
}
MODELS = {"frictionpatch6.world": 26, "rough_terrain_gap.world": 44}


@pytest.fixture(scope="module", params=READINGS)
def real(request):
    path = WORLDS / request.param
    if not path.is_file():
        pytest.skip(f"needs {request.param} in a folder shared/worlds beside the checkout")
    return read_world(path, READINGS[request.param])


def test_everything_is_where_its_state_has_it(real):
    state = ElementTree.fromstring(real.text).find("world/state")
    assert len(real.models) == MODELS[real.path.name]
    assert len(state.findall("model")) == len(real.models)
    for saved in state.findall("model"):
        links = {link.name: link for link in real.model(saved.get("name")).links}
        for link in saved.findall("link"):
            numbers = [float(word) for word in link.find("pose").text.split()]
            assert links[link.get("name")].pose.position == pytest.approx(numbers[:3], abs=1e-3)


SCALED = {
    "frictionpatch6.world": {},
    "rough_terrain_gap.world": {"asphalt_plane": 1.4296, "asphalt_plane_clone": 1.06472},
}


def test_sizes_are_as_gazebo_scaled_them(real):
    state = ElementTree.fromstring(real.text).find("world/state")
    scaled = {
        saved.get("name") for saved in state.findall("model") if saved.find("scale").text != "1 1 1"
    }
    assert scaled == set(SCALED[real.path.name])
    for name, height in SCALED[real.path.name].items():
        assert real.model(name).collisions[0].shape == Box(pytest.approx((20, 20, height)))


@examples(0.25)
@given(data=st.data())
def test_a_smaller_world_is_the_same_text_without_the_removed_models_and_their_states(real, data):
    removed = data.draw(st.sets(st.sampled_from(real.elements())))
    text = without(real, frozenset(removed))
    assert text == _by_hand(real.text, removed)
    again = parse_world(text, real.path, READINGS[real.path.name])
    assert [model.name for model in again.models] == [
        m.name for m in real.models if m.name not in removed
    ]
    assert all(model.links == real.model(model.name).links for model in again.models)


def _by_hand(text, removed):
    """The lines of `text` but those from a removed model's opening tag to its closing one, wherever
    such a model stands.
    """
    kept, closing = [], None
    for line in text.split(b"\n"):
        bare = line.strip()
        if closing is None and bare.startswith(b"<model name="):
            name = bare.split(b"'")[1].decode()
            if name in removed:
                closing = line[: len(line) - len(line.lstrip())] + b"</model>"
        if closing is None:
            kept.append(line)
        elif line == closing:
            closing = None
    return b"\n".join(kept)


def test_the_converted_world_loads_in_drake(real, tmp_path):
    write_converted(real, tmp_path / "clean.sdf")
    assert_same_in_drake(real, tmp_path / "clean.sdf")
