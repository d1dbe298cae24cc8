import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.access import Missing, Unusable, read
from ddenv.world.files.resources import Resources, find, fuel_model, model_file, model_named
from ddenv.world.files.roots import search_roots
from tests.tiers import examples

pytestmark = pytest.mark.usefixtures("no_gazebo")


@pytest.fixture
def models(tmp_path) -> Path:
    folder = tmp_path / "models"
    put(folder / "box" / "model.sdf")
    put(folder / "box" / "meshes" / "a b.dae")
    put(folder / "Oak tree" / "model.sdf")
    put(folder / "media" / "m.dae")
    put(tmp_path / "secret.dae")
    return folder


def put(path: Path, text: str = "x") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_folders_in_order_without_doubles(tmp_path, monkeypatch):
    names = (
        "own",
        "world",
        "gz",
        "ignition",
        "home/models",
        "classic",
        "sdf",
        "home/.gazebo/models",
        "ros1",
        "ros2/share",
    )
    folders = {name: tmp_path / name for name in names}
    for folder in folders.values():
        folder.mkdir(parents=True)
    monkeypatch.setenv(
        "GZ_SIM_RESOURCE_PATH", f"{folders['gz']}{os.pathsep}{os.pathsep}{tmp_path / 'gone'}"
    )
    monkeypatch.setenv("IGN_GAZEBO_RESOURCE_PATH", str(folders["ignition"]))
    monkeypatch.setenv(
        "GAZEBO_MODEL_PATH", f"~/models{os.pathsep}{folders['classic']}/{os.pathsep}~nobody/x"
    )
    monkeypatch.setenv("SDF_PATH", f"{folders['sdf']}{os.pathsep}{folders['gz']}/../gz")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(folders["ros1"]))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'ros2'}{os.pathsep}{tmp_path / 'gone'}")
    found = search_roots([folders["own"], tmp_path / "none"], folders["world"])
    assert tuple(found) == tuple(folders.values())


def test_a_package_of_ros_is_found_in_its_share_folder_or_by_its_own(tmp_path, monkeypatch):
    new = put(tmp_path / "ros2" / "share" / "cart" / "meshes" / "cart.dae")
    old = put(tmp_path / "src" / "lamp" / "lamp.dae")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros2"))
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "src" / "lamp"))
    folders = search_roots([], tmp_path)
    for scheme in ("package", "model"):
        assert find(f"{scheme}://cart/meshes/cart.dae", tmp_path, folders) == new
        assert find(f"{scheme}://lamp/lamp.dae", tmp_path, folders) == old


@pytest.mark.parametrize(
    ("uri", "expected"),
    [
        ("model://box", "models/box"),
        ("model://box/", "models/box"),
        ("  model://box/model.sdf\n", "models/box/model.sdf"),
        ("MODEL:///box", "models/box"),
        ("model://box/meshes/a%20b.dae", "models/box/meshes/a b.dae"),
        ("model://box/meshes/../model.sdf", "models/box/model.sdf"),
        ("package://box/meshes/a b.dae", "models/box/meshes/a b.dae"),
        ("model://models/box", "models/box"),
        ("meshes/a b.dae", "models/box/meshes/a b.dae"),
        ("./meshes/a%20b.dae", "models/box/meshes/a b.dae"),
        ("../media/m.dae", "models/media/m.dae"),
        ("file://media/m.dae", "models/media/m.dae"),
        ("media/m.dae", "models/media/m.dae"),
        ("box", "models/box"),
    ],
)
def test_found(models, tmp_path, uri, expected):
    assert find(uri, models / "box", (models,)) == tmp_path / expected


def test_absolute(models):
    path = models / "box" / "meshes" / "a b.dae"
    assert find(f"file://{str(path).replace(' ', '%20')}", models, ()) == path
    assert find(f"{models}/box/../box/meshes/a b.dae", models, ()) == path


def test_first_folder_wins(models, tmp_path):
    other = put(tmp_path / "other" / "box" / "model.sdf").parent.parent
    assert find("model://box/model.sdf", tmp_path, (other, models)) == other / "box" / "model.sdf"
    assert find("model://box/meshes", tmp_path, (other, models)) == models / "box" / "meshes"


@pytest.mark.parametrize(
    "uri",
    [
        "model://../secret.dae",
        "model://box/../../secret.dae",
        "model://%2e%2e/secret.dae",
        "model://box/%2E%2E%2f..%2fsecret.dae",
        "package://box/../../secret.dae",
        "../../secret.dae",
        "file://../../secret.dae",
        "meshes/../../../secret.dae",
        "https://fuel.gazebosim.org/1.0/o/models/box/1/files/../../../../../../secret.dae",
        "https://fuel.gazebosim.org/1.0/../models/box",
        "https://fuel.gazebosim.org/1.0/o/models/%2e%2e/box",
    ],
)
def test_climbing_is_refused(models, uri):
    with pytest.raises(Unusable, match=r"leaves its folder with '\.\.'"):
        find(uri, models / "box", (models,))


@pytest.mark.parametrize(
    ("uri", "reason"),
    [
        ("", "names no file"),
        ("   ", "names no file"),
        ("model://", "names no file"),
        ("model:///", "names no file"),
        ("model://.", "names no file"),
        ("file://", "names no file"),
        ("model://box%00.dae", "NUL byte"),
        ("a\0b", "NUL byte"),
        ("ftp://host/box.dae", "scheme 'ftp:' is not supported"),
        ("data:model/obj;base64,AAAA", "scheme 'data:' is not supported"),
        ("model://" + "x" * 5000, "cannot be read: File name too long"),
        ("x" * 300, "File name too long"),
        ("model://\ud800", "is not a valid file name"),
    ],
)
def test_unusable(models, uri, reason):
    with pytest.raises(Unusable, match=reason) as caught:
        find(uri, models, (models,))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("uri", "reason"),
    [
        ("model://none", r"looked in /"),
        ("none.dae", "looked beside the file"),
        ("/none/x.dae", "there is no such file"),
        ("model://box/model.sdf/x", "looked in /"),
        ("https://example.org/box.dae", "is not downloaded"),
        ("https://fuel.gazebosim.org/1.0/o/worlds/box", "Fuel cache"),
        ("https://fuel.gazebosim.org/1.0/o/things/box", "is not downloaded"),
        ("https://fuel.gazebosim.org/1.0/o/models/none", "Fuel cache"),
    ],
)
def test_missing(models, uri, reason):
    with pytest.raises(Missing, match=reason):
        find(uri, models, (models,))


def test_fuel_cache(tmp_path, monkeypatch):
    cache = (
        tmp_path
        / "home"
        / ".gz"
        / "fuel"
        / "fuel.gazebosim.org"
        / "openrobotics"
        / "models"
        / "oak tree"
    )
    for version in ("2", "9", "10", "tip"):
        put(cache / version / "meshes" / "oak.dae")
    start = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/Oak%20tree"
    assert find(start, tmp_path, ()) == cache / "10"
    assert find(f"{start}/tip", tmp_path, ()) == cache / "10"
    assert find(f"{start}/2", tmp_path, ()) == cache / "2"
    assert (
        find(f"{start}/2/files/meshes/oak.dae", tmp_path, ()) == cache / "2" / "meshes" / "oak.dae"
    )
    assert (
        find(f"{start}/files/meshes/oak.dae", tmp_path, ()) == cache / "10" / "meshes" / "oak.dae"
    )
    old = start.replace("gazebosim", "ignitionrobotics")
    assert find(f"{old}/9", tmp_path, ()) == cache / "9"
    with pytest.raises(Missing):
        find(f"{start}/3", tmp_path, ())
    monkeypatch.setenv("GZ_FUEL_CACHE_PATH", str(tmp_path / "elsewhere"))
    with pytest.raises(Missing):
        find(start, tmp_path, ())


def test_the_fuel_cache_is_searched_for_a_models_name_last(tmp_path, models):
    fuel = tmp_path / "home" / ".ignition" / "fuel" / "fuel.gazebosim.org"
    for owner in ("aaron", "openrobotics"):
        for version in ("2", "11"):
            put(fuel / owner / "models" / "pine tree" / version / "meshes" / "pine.dae")
            put(fuel / owner / "models" / "box" / version / "model.sdf")
    gazebos = fuel / "openrobotics" / "models" / "pine tree" / "11"
    assert find("model://pine_tree", tmp_path, (models,)) == gazebos
    assert (
        find("model://Pine%20tree/meshes/pine.dae", tmp_path, ()) == gazebos / "meshes" / "pine.dae"
    )
    assert find("model://box", tmp_path, (models,)) == models / "box"
    with pytest.raises(Unusable, match="leaves its folder"):
        find("model://pine_tree/../../secret", tmp_path, ())
    with pytest.raises(Missing, match="and the Fuel cache"):
        find("model://pine_tree/none.dae", tmp_path, (models,))


@pytest.mark.parametrize(
    ("uri", "name"),
    [
        ("model://sun", "sun"),
        (" model://Construction%20Barrel/meshes/a.dae", "construction_barrel"),
        ("package://cart/a.dae", "cart"),
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/models/Ground Plane/3", "ground_plane"),
        ("https://fuel.gazebosim.org/1.0/OpenRobotics/worlds/Sun", ""),
        ("https://example.org", ""),
        ("meshes/sun.dae", ""),
        ("file:///sun", ""),
        ("model://", ""),
    ],
)
def test_the_name_of_the_model_in_a_uri(uri, name):
    assert model_named(uri) == name


@pytest.mark.parametrize("name", ["Oak tree", "Oak%20tree", "oak_tree", "OAK TREE"])
def test_fuel_model_in_the_model_path(models, name):
    uri = f"https://fuel.ignitionrobotics.org/1.0/o/models/{name}/3/files/model.sdf"
    assert find(uri, models, (models,)) == models / "Oak tree" / "model.sdf"


def test_folder_that_cannot_be_looked_at(models, tmp_path):
    class Locked(type(tmp_path)):
        def stat(self, **options):
            raise PermissionError(13, "Permission denied", str(self))

    assert find("model://box", tmp_path, (Locked(tmp_path), models)) == models / "box"
    with pytest.raises(Unusable, match="cannot be read: Permission denied"):
        find("model://none", tmp_path, (Locked(tmp_path), models))


def config(folder: Path, *entries: str) -> Path:
    put(folder / "model.config", f"<model><name>x</name>{''.join(entries)}</model>")
    return folder


def test_model_file(tmp_path):
    for name in ("model.sdf", "old.sdf", "new.sdf", "future.sdf"):
        put(tmp_path / name)
    assert model_file(tmp_path).name == "model.sdf"
    config(
        tmp_path,
        "<sdf version='1.4'>old.sdf</sdf>",
        "<sdf version='1.12'>new.sdf</sdf>",
        "<sdf>model.sdf</sdf>",
    )
    assert model_file(tmp_path).name == "new.sdf"
    config(tmp_path, "<sdf version='1.9'> old.sdf </sdf>", "<sdf version='1.13'>future.sdf</sdf>")
    assert model_file(tmp_path).name == "old.sdf"
    config(tmp_path, "<sdf version='2.0'>future.sdf</sdf>", "<sdf version='1.5'/>")
    assert model_file(tmp_path).name == "model.sdf"
    config(tmp_path, "<sdf version='one'>old.sdf</sdf>")
    assert model_file(tmp_path).name == "old.sdf"


@pytest.mark.parametrize(
    "text",
    [
        "<model",
        "",
        "<!DOCTYPE x [<!ENTITY a 'b'>]><model>&a;</model>",
        "<model><sdf version='1.6'>../../secret.sdf</sdf></model>",
        "<?xml version='1.0' encoding='nonsense'?><model/>",
    ],
)
def test_bad_model_config(tmp_path, text):
    put(tmp_path / "model.config", text)
    with pytest.raises(Unusable, match=r"model\.config"):
        model_file(tmp_path)
    put(tmp_path / "model.sdf")
    if "../.." not in text:
        assert model_file(tmp_path).name == "model.sdf"
        return
    with pytest.raises(Unusable, match=r"model\.config"):
        model_file(tmp_path)


def test_model_folder_without_file(tmp_path):
    with pytest.raises(Missing, match="neither"):
        model_file(tmp_path)
    with pytest.raises(Missing, match="which does not exist"):
        model_file(config(tmp_path, "<sdf version='1.6'>gone.sdf</sdf>"))


def test_read_refuses_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, reason in (
        ("", "is a folder"),
        ("pipe", "not a regular file"),
        ("none", "no such file"),
    ):
        with pytest.raises(Unusable, match=reason):
            read(tmp_path / name, 10)
    with pytest.raises(Unusable, match="the maximum is"):
        read(put(tmp_path / "big", "x" * 11), 10)
    assert read(put(tmp_path / "fits", "x" * 10), 10) == b"x" * 10


WORDS = st.sampled_from(
    [
        "..",
        ".",
        "box",
        "%2e%2e",
        "%2f",
        "/",
        "//",
        "model:",
        "file:",
        "https:",
        "~",
        "\0",
        "a b",
        "\ud800",
    ]
)


@examples(2)
@given(words=st.lists(WORDS | st.text(max_size=4), max_size=6))
def test_any_uri_stays_inside_or_is_refused(tmp_path_factory, words):
    folder = tmp_path_factory.getbasetemp() / "inside"
    put(folder / "box" / "box")
    uri = "/".join(words)
    try:
        path = find(uri, folder / "box", (folder,))
    except (Missing, Unusable) as error:
        assert "\n" not in str(error)
    else:
        is_absolute = uri.strip().replace("file:", "", 1).startswith(("/", "%2f"))
        assert path.is_relative_to(folder) or is_absolute


def test_models_that_go_with_a_world_are_found_by_themselves(tmp_path):
    beside = put(tmp_path / "pkg" / "models" / "crate" / "model.sdf")
    inside = put(tmp_path / "pkg" / "worlds" / "models" / "lamp" / "model.sdf")
    for world in (tmp_path / "pkg" / "worlds", tmp_path / "pkg" / "worlds" / "small" / "day"):
        world.mkdir(parents=True, exist_ok=True)
        roots = search_roots([], world)
        assert find("model://crate/model.sdf", world, roots) == beside
        assert roots[tmp_path / "pkg" / "models"] == "models beside worlds"
    roots = search_roots([], tmp_path / "pkg" / "worlds")
    assert find("model://lamp/model.sdf", tmp_path, roots) == inside
    with pytest.raises(Missing):
        find("model://crate", tmp_path, search_roots([], tmp_path / "pkg" / "maps"))


def test_files_of_worlds_in_fuel_and_addresses_without_the_number_of_the_interface(tmp_path):
    host = tmp_path / "home" / ".ignition" / "fuel" / "fuel.ignitionrobotics.org" / "some one"
    mesh = put(host / "worlds" / "big hall" / "3" / "meshes" / "Hall.dae")
    put(host / "models" / "box" / "1" / "model.sdf")
    uri = "https://fuel.gazebosim.org/1.0/Some%20One/worlds/Big%20Hall/tip/files/meshes/Hall.dae"
    assert find(uri, tmp_path, {}) == mesh
    assert (
        find("http://fuel.gazebosim.org//Some One/models/Box/", tmp_path, {})
        == host / "models" / "box" / "1"
    )


def test_a_link_that_leads_out_of_the_cache_is_not_followed(tmp_path):
    secret = put(tmp_path / "secret.sdf", "<sdf version='1.6'/>")
    cache = tmp_path / "home" / ".gz" / "fuel" / "fuel.gazebosim.org" / "o" / "models" / "box" / "1"
    cache.mkdir(parents=True)
    (cache / "model.sdf").symlink_to(secret)
    (cache / "own.sdf").symlink_to(put(cache / "real.sdf"))
    (cache.parent / "2").symlink_to(tmp_path)
    disk = Resources({}, {})
    url = "https://fuel.gazebosim.org/1.0/o/models/box/1"
    for uri in (url, "https://fuel.gazebosim.org/1.0/o/models/box/files/secret.sdf"):
        with pytest.raises(Unusable, match="is a link that leads out of Fuel's cache"):
            disk.sdf(uri, tmp_path)
    assert disk.sdf(f"{url}/files/own.sdf", tmp_path)[1] == b"x"


@pytest.mark.parametrize(
    ("uri", "url"),
    [
        (
            " https://fuel.gazebosim.org/1.0/Open%20R/models/Oak tree/2/files/a.dae",
            "Open%20R/models/Oak%20tree/2",
        ),
        ("http://fuel.ignitionrobotics.org/1.0/o/worlds/w/tip", "o/worlds/w"),
        ("https://FUEL.gazebosim.org/o/models/it's;rm", "o/models/it%27s%3Brm"),
        ("https://fuel.gazebosim.org/1.0/../models/x", None),
        ("https://fuel.gazebosim.org/1.0/o/models/%2e%2e", None),
        ("https://fuel.gazebosim.org/1.0/o/models", None),
        ("https://fuel.gazebosim.org.evil.org/1.0/o/models/x", None),
        ("model://o/models/x", None),
    ],
)
def test_the_model_in_fuel_that_a_uri_belongs_to(uri, url):
    model = fuel_model(uri)
    assert (model and model.url) == (url and f"https://fuel.gazebosim.org/1.0/{url}")
