"""The folders that are searched for models, and what names each of them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from ddenv.world.access import is_folder, without_tilde

# The variables of Gazebo and ROS that list folders of models, and Gazebo Classic's folder of
# downloads, in the order in which they are searched; and the part of each folder that holds the
# models.
PLACES = {
    "GZ_SIM_RESOURCE_PATH": "",
    "IGN_GAZEBO_RESOURCE_PATH": "",
    "GAZEBO_MODEL_PATH": "",
    "SDF_PATH": "",
    "~/.gazebo/models": "",
    "ROS_PACKAGE_PATH": "",
    "AMENT_PREFIX_PATH": "share",
}
VARIABLES = tuple(place for place in PLACES if not place.startswith("~"))
# The folder of worlds in a package of ROS or Gazebo; that of its models is beside it.
WORLDS = "worlds"
MODELS = "models"


def search_roots(model_path: Sequence[Path], world_folder: Path) -> dict[Path, str]:
    """The folders searched for models, with what names each: `model_path`, those around the world,
    then Gazebo's and ROS'.

    They are absolute, exist, and are listed once.
    """
    named = [(folder, "--model-path") for folder in model_path]
    named += around(world_folder)
    named += [(folder, place) for place in PLACES for folder in _listed_in(place)]
    roots: dict[Path, str] = {}
    for folder, source in named:
        if is_folder(folder):
            roots.setdefault(absolute(folder), source)
    return roots


def around(world_folder: Path) -> list[tuple[Path, str]]:
    """The folders of models that go with a world: its own, `models` in it, and `models` beside
    `worlds`.
    """
    folder = absolute(world_folder)
    # The nearest folder of worlds, if the world is in one.
    packages = [each.parent for each in (folder, *folder.parents) if each.name == WORLDS]
    beside = [(package / MODELS, f"{MODELS} beside {WORLDS}") for package in packages[:1]]
    return [
        (folder, "the world's folder"),
        (folder / MODELS, f"{MODELS} in the world's folder"),
        *beside,
    ]


def _listed_in(place: str) -> list[Path]:
    names = os.environ.get(place, "") if place in VARIABLES else place
    return [without_tilde(name) / PLACES[place] for name in names.split(os.pathsep) if name]


def absolute(path: Path) -> Path:
    """`path` made absolute and without `..`; symbolic links are not followed."""
    return Path(os.path.normpath(path.absolute()))


def source_of(path: Path, roots: Mapping[Path, str]) -> tuple[str, Path]:
    """What names the folder of `roots` in which `path` was found, and this folder; "" and its own
    folder if it is in none.
    """
    found = [root for root in roots if absolute(path).is_relative_to(root)]
    nearest = max(found, key=lambda root: len(root.parts), default=path.parent)
    return roots.get(nearest, ""), nearest
