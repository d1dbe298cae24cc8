"""Programs that a scenario brings along: its own controller, another simulator, or a cluster for
its tests.

They start only if the user trusts them: a run file holds its scenario, so one that came by mail can
name any program of this machine. What is trusted is remembered with the contents of the files that
the command names, or of the class's own module. Where one of these changes, the user is asked
again.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import stat
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib.machinery import all_suffixes
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import read_scenario
from ddenv.runs.preferences import read_state, write_state
from ddenv.runs.programs import how_to_install
from ddenv.world.access import is_file
from ddenv.world.command import start_folder
from ddenv.world.scenario import Scenario

HERE = "here"
SSH = "ssh:"
# A scheduler's address; a bracket holds the colons of IPv6.
SCHEDULER = re.compile(r"(tcp|tls)://(\[[\w:.%]+\]|[\w.-]+):\d{1,5}")
FILE = "trusted.json"
# The environment variable with what is trusted without being remembered.
UNREMEMBERED = "DDENV_TRUSTED"
# Begins a scenario's file that ddenv wrote: it may be of a run that somebody sent, whose program
# nobody here has chosen.
WRITTEN = "# Written by ddenv; a program that it starts is asked about.\n"
# Maximum number of files of one program that are looked at.
MOST_FILES = 1000


@dataclass(frozen=True, slots=True)
class Program:
    """What a scenario starts, in words for the user, and digests of it with its files: of a
    program, of a cluster, or of both.
    """

    words: str
    digests: tuple[str, ...]


def program_of(scenario: Scenario) -> Program | None:
    """The program that tests of `scenario` start; None if they start only what ddenv brings."""
    found = [*_own_program(scenario), *_cluster_of(scenario)]
    if not found:
        return None
    return Program(
        ", and ".join(each.words for each in found), sum((each.digests for each in found), ())
    )


def _cluster_of(scenario: Scenario) -> list[Program]:
    """The cluster of its tests, if they are not made here."""
    cluster = scenario.reduction.cluster
    if cluster == HERE:
        return []
    return [
        _program(
            f"its tests on the cluster {cluster}; whoever controls that can start any program here",
            [],
        )
    ]


def _own_program(scenario: Scenario) -> list[Program]:
    """Its simulator or its controller, if it brings one, with the files that its command names, or
    its class's module.
    """
    oracle = scenario.oracle
    what = "controller"
    use = scenario.controller.use
    folder = scenario.folder.absolute()
    if oracle is not None:
        what = "simulator"
        use = oracle.program
        folder = start_folder(scenario).absolute()
        if oracle.command is not None:
            words = list[str]()
            with suppress(ValueError):
                words = shlex.split(oracle.command)
            files = [folder / word for word in words if is_file(folder / word)]
            return [_program(f"the command '{oracle.command}' in {folder}", files)]
    elif ":" not in use:
        return []
    # In every form that Python looks for; an installed module is the user's own choice.
    module = use.partition(":")[0].partition(".")[0]
    # A run file may have the module's name, too, and changes all the time.
    alone = [
        path for path in folder.glob(f"{module}.*") if path.name.endswith(tuple(all_suffixes()))
    ]
    found = (*alone, *(folder / module).rglob("*"))
    # Python itself writes into this folder.
    files = sorted(path for path in found if "__pycache__" not in path.parts and is_file(path))
    return [_program(f"the {what} {use}, searched in {folder} first", files)]


def _program(words: str, files: Iterable[Path]) -> Program:
    contents = []
    for path in islice(files, MOST_FILES):
        digest = ""
        with suppress(OSError), path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        contents.append((str(path), digest))
    return Program(words, (hashlib.sha256(json.dumps([words, contents]).encode()).hexdigest(),))


def untrusted(scenario: Scenario) -> Program | None:
    """The program that tests of `scenario` start, if the user has not trusted it as it is now."""
    program = program_of(scenario)
    if program is None or _trusted().issuperset(program.digests):
        return None
    return program


def trust(program: Program) -> None:
    """Remembers that the user trusts it; where nothing can be remembered, for this process and the
    engines it starts.
    """
    trusted = sorted({*_trusted(), *program.digests})
    write_state(FILE, trusted)
    if not _trusted().issuperset(program.digests):
        os.environ[UNREMEMBERED] = " ".join(trusted)


def _trusted() -> set[str]:
    trusted = set(os.environ.get(UNREMEMBERED, "").split())
    known = read_state(FILE)
    if isinstance(known, list):
        trusted.update(digest for digest in known if isinstance(digest, str))
    return trusted


def is_own(path: Path) -> bool:
    """Whether a file and its folder belong to the user, and others cannot write there."""
    if not hasattr(os, "getuid"):
        # Windows says it in other ways.
        return False
    try:
        found = (path.stat(), path.absolute().parent.stat())
    except (OSError, ValueError):
        return False
    return all(each.st_uid == os.getuid() and not each.st_mode & stat.S_IWOTH for each in found)


def trust_own(scenario: Scenario, path: Path) -> None:
    """Trusts what a scenario starts whose file the user named, owns, and has not from ddenv."""
    program = program_of(scenario)
    if program is not None and is_own(path) and not path.read_bytes().startswith(WRITTEN.encode()):
        trust(program)


def scenario_text(data: Mapping[str, Any], scenario: Scenario) -> bytes:
    """The file of `scenario`, with `data` in it, as ddenv writes it."""
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True)
    return (text if program_of(scenario) is None else WRITTEN + text).encode()


def trust_cluster(scenario: Scenario) -> None:
    """Trusts the cluster of `scenario`, which the user has typed."""
    for cluster in _cluster_of(scenario):
        trust(cluster)


def check_trusted(
    scenario: Scenario, where: Path | str, asks: Callable[[str], bool] = lambda _: False
) -> None:
    """Raises UserError, naming `where` it is from, if tests would start a program that the user has
    not trusted.

    `asks` puts a question to the user; a yes is remembered.
    """
    program = untrusted(scenario)
    if program and asks(f"{where} starts {program.words}. Do you trust it?"):
        trust(program)
        program = untrusted(scenario)
    if program:
        raise UserError(f"{where}: would start {program.words}; if you trust it, give --trust")


def check_named(scenario: Scenario, name: str, asks: Callable[[str], bool]) -> None:
    """The same for what the user named: a file of the user's own is trusted."""
    trust_own(scenario, Path(name))
    check_trusted(scenario, name, asks)


def trusted_scenario(
    file: RunFile, asks: Callable[[str], bool], cluster: str | None = None
) -> Scenario:
    """The scenario of a run, after the same check; the user has typed another `cluster`, if any.

    Raises UserError for a damaged file, too.
    """
    scenario = read_scenario(file)
    check_cluster(cluster or scenario.reduction.cluster)
    check_trusted(made_here(scenario) if cluster else scenario, file.path, asks)
    return scenario


# Where tests are made: on this machine, or by a Dask cluster that the user names.


def check_cluster(cluster: str) -> None:
    """Raises UserError for what is neither `here` nor a cluster that can be asked, and where Dask
    is not installed.
    """
    if cluster == HERE:
        return
    if not (SCHEDULER.fullmatch(cluster) or hosts_of(cluster) or is_file(Path(cluster))):
        raise UserError(
            "options: reduction.cluster: expected here, tcp://HOST:PORT, tls://HOST:PORT, "
            f"ssh:HOST1,HOST2 or the path of a scheduler file that is there, found '{cluster}'"
        )
    if find_spec("distributed") is None:
        raise UserError(
            f"options: reduction.cluster: Dask is not installed here: {how_to_install('cluster')}"
        )


def made_here(scenario: Scenario) -> Scenario:
    """`scenario` with its tests on this machine."""
    return scenario.model_copy(
        update={"reduction": scenario.reduction.model_copy(update={"cluster": HERE})}
    )


def hosts_of(cluster: str) -> list[str]:
    """The hosts of `ssh:HOST1,HOST2`; none for any other cluster."""
    hosts = cluster.removeprefix(SSH).split(",") if cluster.startswith(SSH) else []
    if all(re.fullmatch(r"\w[\w.-]*", host) for host in hosts):
        return hosts
    return []
