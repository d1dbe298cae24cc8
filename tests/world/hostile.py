"""Worlds that mean harm, written in short, and what a command may say of them."""

from __future__ import annotations

import os
import resource
from pathlib import Path

from tests.command import Said, ddenv

# Bytes, and seconds of CPU: generous for a slow machine, and other work on it does not count.
MEMORY = 3 << 30
SECONDS = 30
AT_ONCE = 10
BOX = "<geometry><box><size>1 2 3</size></box></geometry>"
LINK = f"<link name='l'><collision name='c'>{BOX}</collision></link>"
LAUGHS = "".join(f"<!ENTITY l{i + 1} '{f'&l{i};' * 10}'>" for i in range(9))
MODEL = f"<model name='m'>{LINK}</model>"


def world(inside: str, version: str = "1.9", before: str = "") -> bytes:
    return f"{before}<sdf version='{version}'><world name='w'>{inside}</world></sdf>".encode()


def model(inside: str, name: str = "m") -> bytes:
    return world(f"<model name='{name}'>{inside}</model>")


def shape(inside: str) -> bytes:
    return model(
        f"<link name='l'><collision name='c'><geometry>{inside}</geometry></collision></link>"
    )


def include(uri: str, more: str = "") -> str:
    return f"<include><uri>{uri}</uri>{more}</include>"


def joint(inside: str, kind: str = "revolute", name: str = "j") -> str:
    return f"<joint name='{name}' type='{kind}'>{inside}</joint>"


def ends(parent: str, child: str) -> str:
    return f"<parent>{parent}</parent><child>{child}</child>"


def links(count: int) -> str:
    return "".join(f"<link name='l{number}'/>" for number in range(count))


def frame(name: str, relative_to: str) -> str:
    return f"<frame name='{name}'><pose relative_to='{relative_to}'>0 0 1 0 0 0</pose></frame>"


def attached(name: str, to: str) -> str:
    return f"<frame name='{name}' attached_to='{to}'/>"


def sdf_model(name: str, inside: str) -> str:
    return f"<sdf version='1.9'><model name='{name}'>{inside}</model></sdf>"


def check_bounded(*words: object, seconds: int = SECONDS, **environment: str) -> Said:
    """`ddenv world check` in a process of its own, with an end to its time and its memory."""

    def bounded() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))

    return ddenv("world", "check", *words, preexec_fn=bounded, env={**os.environ, **environment})


def refusal(said: Said, path: Path | str) -> str:
    """The one line of a refusal, after the name of the program and of the file."""
    assert "Traceback" not in said.stderr, said.stderr[-2000:]
    assert (said.returncode, said.stdout) == (2, ""), said
    assert said.stderr.endswith("\n") and said.stderr.count("\n") == 1, said.stderr[-2000:]
    line = said.stderr[:-1]
    assert line.isprintable()
    assert line.startswith(f"ddenv: {path}"), line
    return line.removeprefix(f"ddenv: {path}")


def read_or_refused(said: Said, path: Path) -> None:
    if said.returncode == 0:
        assert said.stderr == ""
        assert all(line.isprintable() for line in said.stdout.splitlines()), said.stdout
    else:
        refusal(said, path)
