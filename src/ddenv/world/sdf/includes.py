"""The models inside a model or a world: written in place, or included from other files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from ddenv.errors import UserError
from ddenv.world.access import Missing, Unusable
from ddenv.world.files.resources import FOLDER
from ddenv.world.sdf.context import REASONS, Context, note_unread, refuse, sdf_root
from ddenv.world.sdf.standin import NO_FLOOR, NONE, SIZES, StandIn, guess
from ddenv.world.sdf.urdf import root_of
from ddenv.world.sdf.xml import Element, complain, name_of, text_of, truth
from ddenv.world.write import primitive

# What an included file may hold in place of a model, with the note.
NO_MODELS = {"actor": REASONS["actor"], "light": "nothing can touch it"}
# Prefix of the made-up file names of stand-ins.
STAND_IN = "stand-in "


@dataclass(frozen=True, kw_only=True)
class Part:
    """A model inside another model or a world: its `<model>` (`element`), and the `<include>` that
    names it or itself (`at`).

    `static` is the include's own setting, None without one. `files` are the chain of including
    files, outermost first. The links and joints of a `merged` one belong to the model around it.
    """

    element: Element
    at: Element
    name: str
    files: tuple[Path, ...]
    static: bool | None = None
    merged: bool = False

    @property
    def pose(self) -> Element | None:
        """The `<pose>` in force: an include's own overrides the model's."""
        given = self.at.find("pose")
        if given is None:
            return self.element.find("pose")
        return given

    @property
    def placement_frame(self) -> str:
        """The frame inside the model that the pose places; empty for the model's own."""
        given = "" if self.at is self.element else text_of(self.at.find("placement_frame"))
        return given or (self.element.get("placement_frame") or "").strip()


def included(include: Element, files: tuple[Path, ...], context: Context) -> Part | None:
    """The model that `include` names by its URI; None if it is left out or missing. Raises
    UserError.
    """
    uri = text_of(include.find("uri"))
    if not uri:
        raise complain(include, "has no <uri>")
    if include.find("placement_frame") is not None and include.find("pose") is None:
        raise complain(include, "a <placement_frame> needs a <pose>")
    note_unread(include, context)
    merged = (include.get("merge") or "").strip().lower() in ("true", "1")
    if merged and (include.parent is None or include.parent.tag != "model"):
        if not context.ignores("include"):
            raise refuse(
                include,
                "include",
                "merge='true' puts the links of a model into the model around it; here is none",
            )
        context.note(
            "ignored", include, "merge='true' outside of a model: left out by --ignore include"
        )
        return None
    root = _root(include, uri, context)
    if root is None:
        return None
    if root.source in files:
        chain = " includes ".join(
            path.name for path in (*files[files.index(root.source) :], root.source)
        )
        raise complain(include, f"the includes form a cycle: {chain}")
    models = root.findall("model")
    instead = [why for tag, why in NO_MODELS.items() if root.find(tag) is not None]
    if instead and not models:
        context.note("ignored", include, instead[0])
        return None
    if len(models) != 1:
        found = f"{len(models)} <model> elements" if models else "no <model>"
        raise complain(include, f"{root.source} holds {found}; expected one")
    own = _last_of(uri) if root.source.name.startswith(STAND_IN) else name_of(models[0])
    static = truth(include, "static", False) if include.find("static") is not None else None
    name = text_of(include.find("name")) or own
    # The name of its frame in libsdformat, which nothing else may have.
    name = f"_merged__{name}__model__" if merged else name
    return Part(
        element=models[0],
        at=include,
        name=name,
        files=(*files, root.source),
        static=static,
        merged=merged,
    )


def _last_of(uri: str) -> str:
    """The name of a model that is known by its URI alone."""
    return unquote(uri).rstrip("/").rsplit("/", 1)[-1].removesuffix(".sdf") or "model"


def _root(include: Element, uri: str, context: Context) -> Element | None:
    """The root of the included file; None if it is missing or broken (noted or remembered in
    `context`).
    """
    if uri in context.missing:
        return None
    given = context.stand_in(uri)
    if given is not None and given[1] == NONE:
        context.note("ignored", include, f"'{uri}' is left out as asked")
        return None
    if given is not None:
        _note_replaced(include, uri, f"the stand-in {given[0]}", context)
        return _stand_in_root(include, *given)
    try:
        root = _file_root(include, uri, context)
        if root.source.parent == FOLDER and root.find("model") is not None:
            _note_replaced(
                include, uri, "the one built into ddenv, which is like Gazebo's", context
            )
        return root
    except (Missing, Unusable, UserError) as error:
        if context.may_guess(uri):
            return _guessed_root(include, uri, context)
        is_missing = isinstance(error, Missing)
        problem = "was not found" if is_missing else "cannot be included"
        why = f"'{uri[:200]}' {problem}: {error}"
        if context.ignores("include"):
            context.note("ignored", include, why)
            return None
        # Another folder would not help if the file is there.
        folder = "its folder with --model-path, " if is_missing else ""
        remedies = (
            f"give {folder}a shape for it with --stand-in '{uri[:200]}=box:1,1,1' (m; or "
            "cylinder, sphere, ...), have one guessed with --stand-in auto, or leave it out with "
            "--ignore include"
        )
        if not is_missing:
            context.unreadable[uri] = str(error)
        context.missing.setdefault(uri, complain(include, f"{why}; {remedies}"))
        return None


def _file_root(include: Element, uri: str, context: Context) -> Element:
    """The root of the file that `uri` names. Raises Missing, Unusable and UserError."""
    path, text = context.resources.sdf(uri, include.source.parent)
    if path in context.files:
        return context.files[path]
    names_folder = not uri.rstrip("/").endswith(path.name)
    if names_folder and (fault := context.resources.config_fault(path.parent)):
        context.note(
            "ignored", include, f"model.config of '{uri[:200]}', {fault}; {path.name} is taken"
        )
    root = context.files[path] = root_of(text, path, context)
    return root


def _note_replaced(include: Element, uri: str, by: str, context: Context) -> None:
    outer = context.model
    context.model = _model_of(include, uri, context)
    context.note("replaced", include, f"'{uri}' by {by}")
    context.model = outer


def _model_of(include: Element, uri: str, context: Context) -> str:
    """The world's model that an included one belongs to."""
    return context.model or text_of(include.find("name")) or _last_of(uri)


def _guessed_root(include: Element, uri: str, context: Context) -> Element | None:
    """A file with a guess for a missing model; None if nothing is guessed for it."""
    guessed = guess(uri)
    if guessed is None:
        context.note("ignored", include, f"'{uri}' {NO_FLOOR}")
        return None
    stand_in, words, why, _ = guessed
    _note_replaced(include, uri, f"a guess, {words}: {why}", context)
    context.guessed.append((_model_of(include, uri, context), uri))
    return _stand_in_root(include, words, stand_in)


def _stand_in_root(include: Element, text: str, stand_in: StandIn) -> Element:
    """A file with one static model of the stand-in's shape."""
    if isinstance(stand_in, str):
        raise complain(
            include,
            f"the stand-in '{text}' is for meshes; use one of {', '.join(SIZES)} for a whole model",
        )
    kind, sizes = primitive(stand_in.shape)
    words = "".join(
        f"<{tag}>{' '.join(map(repr, values))}</{tag}>" for tag, values in sizes.items()
    )
    pose = " ".join(repr(value) for value in (*stand_in.offset.position, 0.0, 0.0, 0.0))
    inside = f"<pose>{pose}</pose><geometry><{kind}>{words}</{kind}></geometry>"
    sdf = (
        '<sdf version="1.12"><model name="stand-in"><static>true</static><link name="link">'
        f'<collision name="stand-in">{inside}</collision></link></model></sdf>'
    )
    return sdf_root(sdf.encode(), include.source.parent / f"{STAND_IN}{text}")
