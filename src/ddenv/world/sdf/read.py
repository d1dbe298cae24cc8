"""Reads an SDF world or model file, or a URDF robot, into plain data (`ddenv.world.model`).

We read SDF ourselves because Drake's parser refuses many files that simulators accept, and silently
drops parts of others. This reader notes everything that it replaces or ignores (`World.notes`), and
refuses what it does not understand, with file, line and XPath. It never guesses.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import chain
from pathlib import Path

from ddenv.errors import UserError
from ddenv.world.access import is_directives, read_bytes
from ddenv.world.files.resources import Resources
from ddenv.world.files.roots import search_roots
from ddenv.world.model import Box, Collision, Mesh, Model, World, unique_names
from ddenv.world.pose import vector
from ddenv.world.scenario import PLAIN, Reading
from ddenv.world.sdf.assemble import assemble, state_entries
from ddenv.world.sdf.context import Context, how_to_include, note_unread, sdf_root
from ddenv.world.sdf.frames import FARTHEST, Scope, TooFar
from ddenv.world.sdf.inside import has_includes, opened, with_copies
from ddenv.world.sdf.population import copies
from ddenv.world.sdf.urdf import root_of, without_mass
from ddenv.world.sdf.welds import parse_directives
from ddenv.world.sdf.xml import Element, complain, name_of, numbers, parse

GRAVITY = (0.0, 0.0, -9.8)  # SDF's default, m/s^2


def read_world(path: Path, reading: Reading = PLAIN) -> World:
    """The world in the SDF file `path`. Raises UserError with file, line and XPath."""
    return parse_world(read_bytes(path), path, reading)


def parse_world(
    text: bytes, path: Path, reading: Reading = PLAIN, resources: Resources | None = None
) -> World:
    """The world in `text`, the content of `path`; other files come from `resources`, by default
    from disk. Raises UserError.
    """
    context = Context(resources=resources or disk_of(path, reading), reading=reading)
    try:
        if is_directives(path):
            world = parse_directives(text, path, context)
        else:
            world = _world(text, path, context)
    except UserError:
        # The error may only be a consequence of a missing file, such as a pose relative to a model
        # in it.
        context.complain_of_missing()
        raise
    except RecursionError:
        raise UserError(f"{path}: models or frames are nested too deeply") from None
    # Which meshes are to be cut is known after a whole reading; with their pieces it is made again.
    if context.resources.cut():
        return parse_world(text, path, reading, context.resources)
    return world


def read_model(path: Path, reading: Reading = PLAIN) -> Model:
    """The one model in the SDF or URDF file `path`, such as a robot. Raises UserError."""
    return parse_model(read_bytes(path), path, reading)


def parse_model(
    text: bytes, path: Path, reading: Reading = PLAIN, resources: Resources | None = None
) -> Model:
    """The one model in `text`, the content of `path`; other files come from `resources`, by default
    from disk. Raises UserError.
    """
    context = Context(resources=resources or disk_of(path, reading), reading=reading)
    scope = Scope(root_of(text, path, context), (path,), context)
    if len(scope.parts) != 1:
        raise UserError(f"{path}: expected one <model> inside <sdf>, found {len(scope.parts)}")
    try:
        model = assemble(scope.parts[0], scope.parts[0].name, scope, None, context)
        context.complain_of_missing()
        if context.resources.cut():
            return parse_model(text, path, reading, context.resources)
        return without_mass(model, scope.parts[0].element)
    except RecursionError:
        raise UserError(f"{path}: models or frames are nested too deeply") from None


def disk_of(path: Path, reading: Reading) -> Resources:
    """The files beside the world `path`, and those in the folders of `reading.model_path`. Raises
    UserError.
    """
    for folder in reading.model_path:
        if not folder.is_dir():
            raise UserError(f"reading.model_path: there is no folder {folder}")
    return Resources({}, search_roots(reading.model_path, path.parent))


def _world(text: bytes, path: Path, context: Context) -> World:
    root = sdf_root(text, path)
    context.note_tolerance(root, text)
    worlds = root.findall("world")
    if len(worlds) != 1:
        found = "no <world>" if not worlds else f"{len(worlds)} <world> elements"
        if root.find("model") is not None:
            instead = f"; to use its model in a world, {how_to_include(path)}"
        else:
            instead = ""
        raise UserError(f"{path}: expected one <world> inside <sdf>, found {found}{instead}")
    world = worlds[0]
    joint = world.find("joint")
    if joint is not None:
        raise complain(joint, "joints between models are not supported; put both models into one")
    note_unread(world, context)
    scope = Scope(world, (path,), context)
    clones = [
        part
        for population in world.findall("population")
        for part in copies(population, (path,), context)
    ]
    scope.parts += clones
    copied = {clone.at.start for clone in clones}
    models = _models(scope, state_entries(world), context)
    context.complain_of_missing()
    context.model = ""
    context.note_unused(root)
    anchors = scope.references()
    gravity = next(
        (each for tag in ("gravity", "physics/gravity") for each in world.findall(tag)), None
    )
    whole = World(
        path=path,
        name=world.get("name") or "",
        text=text,
        gravity=GRAVITY if gravity is None else vector(numbers(gravity, 3)),
        models=models,
        version=root.get("version") or "",
        anchors=frozenset(
            model.name for model in models if model.name in anchors or model.spans[0][0] in copied
        ),
    )
    whole = context.recorded(whole)
    # Of a mesh that is yet to be cut nothing can be opened.
    if context.reading.inside and not context.resources.uncut:
        return _opened(whole, root, scope, context)
    return whole


def _opened(world: World, root: Element, scope: Scope, context: Context) -> World:
    """`world` with the parts of its models as models; models from other files are first copied into
    its text.
    """
    part_at = {part.at.start: part for part in scope.parts}
    parts = {
        model.name: part_at[model.spans[0][0]]
        for model in world.models
        if model.static and model.name not in world.anchors and len(model.collisions) > 1
    }
    parts = {name: part for name, part in parts.items() if has_includes(part)}
    reading = context.reading.model_copy(update={"inside": False})

    def solid(model: Model) -> list[Collision]:
        """What can be touched of a model. A mesh and its copy differ in their origin alone."""
        box = Box((0.0, 0.0, 0.0))
        return [
            replace(one, shape=box) if isinstance(one.shape, Mesh) else one
            for one in model.collisions
        ]

    while parts:
        text = with_copies(world.text, world.path, scope, list(parts.values()), context.resources)
        try:
            again = parse_world(text, world.path, reading, context.resources)
        except UserError:
            break
        # What was written is read again: only that shows that each model is what it was.
        wrong = {name for name in parts if solid(again.model(name)) != solid(world.model(name))}
        if not wrong:
            return opened(replace(again, notes=world.notes), parse(text, world.path))
        parts = {name: part for name, part in parts.items() if name not in wrong}
    return opened(world, root)


def _models(scope: Scope, state: dict[str, list[Element]], context: Context) -> tuple[Model, ...]:
    """The models of a world, but for those that are too far away to be simulated."""
    names = [part.name for part in scope.parts]
    counts = Counter(names)
    models = []
    for part, name in zip(scope.parts, unique_names(names, " #"), strict=True):
        context.model = name
        if scope.is_left_out(part):
            context.note("ignored", part.at, "all that it includes is left out")
            continue
        if name != part.name:
            context.note(
                "replaced", part.at, f"its name, used {counts[part.name]} times, by '{name}'"
            )
        entries = state.get(part.name)
        entry = entries.pop(0) if entries else None
        try:
            models.append(assemble(part, name, scope, entry, context))
        except TooFar:
            # A world that was saved while it ran holds what had fallen out of it.
            context.note(
                "ignored", part.at, f"it is not simulated: it is more than {FARTHEST:g} m away"
            )
    context.model = ""
    for entry in chain(*state.values()):
        context.note("ignored", entry, f"the world has no model '{name_of(entry)}'")
    return tuple(models)
