"""Downloads the models in Gazebo Fuel that a world or a robot needs and that are not here, where
the user asks for it.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runs.experiment import Parse
from ddenv.world.access import MissingFiles, Unusable, read_bytes
from ddenv.world.files.fuel import FuelModel
from ddenv.world.files.fuel_download import Archive, Shown, download
from ddenv.world.files.resources import fuel_model
from ddenv.world.scenario import Reading
from ddenv.world.sdf.read import disk_of


def fetch_missing(
    file: Path,
    reading: Reading,
    parse: Parse,
    *,
    show: Callable[[FuelModel], Shown],
    tell: Callable[[str], None],
    advice: str,
) -> None:
    """Downloads the missing models that a file names, then those that these name, and so on;
    `parse` reads the file.

    `show` gets each model before it comes, and `tell` a line on it when it is there. `advice` says
    how to leave one out, with `{}` for a stand-in of none. Raises UserError.
    """
    whole = reading.model_copy(update={"inside": False})
    tried: set[FuelModel] = set()
    while missing := {
        model: uri
        for model, uri in missing_models(file, whole, parse).items()
        if model not in tried
    }:
        for model, uri in missing.items():
            try:
                folder, archive = download(model, show(model))
            except Unusable as error:
                leave = advice.format(shlex.quote(f"{uri}=none"))
                raise UserError(f"{model.url} cannot be fetched: {error}; {leave}") from None
            tell(_words(folder, archive))
            tried.add(model)


def missing_models(file: Path, reading: Reading, parse: Parse) -> dict[FuelModel, str]:
    """The models in Fuel that a file names and that are not on this machine, each with a URI that
    names it.

    Raises UserError for other faults.
    """
    resources = disk_of(file, reading)
    with suppress(MissingFiles):
        parse(read_bytes(file), file, reading, resources)
    return {model: uri for uri in resources.absent() if (model := fuel_model(uri))}


def _words(folder: Path, archive: Archive | None) -> str:
    if archive is None:
        return f"{folder} was there already, and was left as it is; remove it to fetch it anew"
    return f"fetched {archive.url}, {archive.size / 1e6:.1f} MB, SHA-256 {archive.sha256}: {folder}"
