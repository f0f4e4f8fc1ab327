"""The files beside a glTF: which of them an export before this one made, and how those of a new one take their place."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from .report import OutputError


def files_of_earlier(target: Path) -> set[Path]:
    """The files beside a glTF to which it refers, if an exporter of ours made it; none where there is no such file."""
    try:
        root = _json_of(target)
        extras = root["scenes"][0]["extras"]["buzz"]
        if not extras["generator"].startswith("Buzz "):
            return set()
        uris = [item.get("uri", "") for key in ("buffers", "images") for item in root.get(key, [])]
        uris.append((extras.get("world") or {}).get("image", ""))
        names = [unquote(uri) for uri in uris]
    except (OSError, ValueError, LookupError, TypeError, AttributeError, struct.error):
        return set()
    # Whatever else it refers to was put there by hand.
    ours = re.compile(re.escape(target.stem) + r"(-\d+)?(\.bin|_world(-\d+)?\.\w+|_textures/[^/\\]+)")
    return {file for name in names if ours.fullmatch(name) and (file := target.parent / name).is_file()}


def put_in_place(new: list[tuple[Path, Path]], earlier: Iterable[Path], aside: Path) -> None:
    """Move files to their places, the named one last, and what was made earlier to the folder `aside`: all of it or nothing.

    Only the last may replace something else.
    """
    moves = [(old, aside / f"earlier-{i}") for i, old in enumerate(sorted(earlier))] + new
    target = new[-1][1]
    folders = {file.parent for move in moves for file in move} - {aside, target.parent}
    done: list[tuple[Path, Path]] = []
    try:
        for source, place in moves:
            try:
                place.parent.mkdir(exist_ok=True)
                if place != target and os.path.lexists(place):
                    raise FileExistsError(errno.EEXIST, f"{place.name} has come there meanwhile")
                os.replace(source, place)
            except OSError as error:
                raise unwritable(place, error) from error
            done.append((source, place))
    except BaseException:
        for source, place in reversed(done):
            os.replace(place, source)
        raise
    finally:
        for folder in folders:
            remove_if_empty(folder)


def remove_if_empty(folder: Path) -> None:
    """Remove a folder in which nothing is."""
    with contextlib.suppress(OSError):
        folder.rmdir()


def unwritable(path: Path, error: OSError) -> OutputError:
    """The line for a file that could not be written."""
    return OutputError(f"{path}: cannot be written ({error.strerror or error}); choose another name or folder")


def _json_of(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        head = file.read(20)
        if head[:4] != b"glTF":
            return json.loads(head + file.read())
        return json.loads(file.read(struct.unpack_from("<I", head, 12)[0]))
