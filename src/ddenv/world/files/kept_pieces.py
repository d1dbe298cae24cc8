"""Keeps the pieces of meshes in the user's cache: cutting a fine mesh takes seconds, and the same
mesh is in many worlds.

Only time depends on it. A run has its own copy, and what is damaged is cut again.
"""

from __future__ import annotations

import hashlib
import os
from importlib.metadata import version
from pathlib import Path

import platformdirs

from ddenv.arrays import Floats, Integers
from ddenv.errors import UserError
from ddenv.world.access import Unusable, write_file
from ddenv.world.files.meshes import unpack_pieces

# Another number makes the pieces of earlier versions of this program unknown.
RULES = 1
# What this program cut. No file has the meshes that could not be cut: they have no pieces until
# another program tries them.
KNOWN: dict[Path, bytes] = {}
# Vertices (N, 3) m, faces (M, 3), and the maximum number of pieces.
ToCut = tuple[Floats, Integers, int]


def kept_file(vertices: Floats, faces: Integers, most: int) -> Path:
    """Where the pieces of a mesh, at most `most`, are kept: in `$DDENV_HOME/cache`, or in the
    user's cache folder.
    """
    home = os.environ.get("DDENV_HOME")
    if home:
        folder = Path(home) / "cache"
    else:
        folder = Path(platformdirs.user_cache_dir("ddenv", appauthor=False))
    digest = hashlib.blake2b(digest_size=16)
    digest.update(f"{RULES} {version('manifold3d')} {most} {len(vertices)} ".encode())
    digest.update(vertices.astype("<f8").tobytes())
    digest.update(faces.astype("<u4").tobytes())
    return folder / "pieces" / digest.hexdigest()


def read_kept(file: Path) -> bytes | None:
    """The packed pieces that are kept as `file`; None if that is not known."""
    if file in KNOWN:
        return KNOWN[file]
    try:
        packed = file.read_bytes()
        unpack_pieces("", packed)
    except (OSError, Unusable):
        return None
    return packed


def keep(file: Path, packed: bytes) -> None:
    """Keeps packed pieces as `file`; if that cannot be written, only in this program."""
    KNOWN[file] = packed
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_file(file, packed)
    except (OSError, UserError):
        return
