"""The files of one export: made in a folder of their own, then put in place together, or not at all.

Of what is already there, only files that an earlier export to the same path refers to are replaced. Where anything else
stands in the way, the files beside the glTF take another name.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
import re
import shutil
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from ..common.document import Document
from ..common.report import OutputError

GENERATOR = "Buzz exporter for Blender"


class Output:
    """Where an export is made (`folder`, under the name `stem`), and where it goes (`path`)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.suffix not in (".gltf", ".glb"):
            raise OutputError(f"{path}: the name must end in .gltf or .glb")
        self._earlier = _files_of(path)
        self._new_folders = [folder for folder in path.parents if not os.path.lexists(folder)]
        try:
            if path.is_dir():
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            path.parent.mkdir(parents=True, exist_ok=True)
            self.stem = next(stem for stem in _stems(path.stem) if self._is_free(stem))
            self.folder = Path(tempfile.mkdtemp(prefix=".export-", dir=path.parent))
        except OSError as error:
            raise self.error(error) from error

    def publish(self, document: Document) -> None:
        """Save the glTF, and put everything in place of what the earlier export left; what fails changes nothing."""
        gltf = self.folder / f"{self.stem}{self.path.suffix}"
        try:
            document.save(gltf)
        except OutputError as error:
            # It names the file in a folder that nobody chose.
            raise error.__cause__ from None
        beside = [file for file in self.folder.rglob("*") if file.is_file() and file != gltf]
        moves = [(old, self.folder / f"earlier-{i}") for i, old in enumerate(sorted(self._earlier))]
        moves += [(file, self.path.parent / file.relative_to(self.folder)) for file in beside]
        moves.append((gltf, self.path))
        folders = {file.parent for move in moves for file in move} - {self.folder, self.path.parent}
        done: list[tuple[Path, Path]] = []
        try:
            for source, target in moves:
                target.parent.mkdir(exist_ok=True)
                if target != self.path and os.path.lexists(target):
                    raise FileExistsError(errno.EEXIST, f"{target.name} has come there meanwhile")
                os.replace(source, target)
                done.append((source, target))
        except BaseException:
            for source, target in reversed(done):
                os.replace(target, source)
            raise
        finally:
            for folder in folders:
                with contextlib.suppress(OSError):
                    folder.rmdir()

    def discard(self) -> None:
        """Remove what is not in place, and folders that were made for nothing."""
        shutil.rmtree(self.folder, ignore_errors=True)
        for folder in self._new_folders:
            with contextlib.suppress(OSError):
                folder.rmdir()

    def error(self, error: OSError) -> OutputError:
        """The line for a file that could not be written."""
        return OutputError(f"{self.path}: cannot be written ({error.strerror or error}); choose another name or folder")

    def _is_free(self, stem: str) -> bool:
        """Whether the files of an export by this name would replace none but those of the earlier one."""
        names = {f"{stem}.bin", f"{stem}_textures"} if self.path.suffix == ".gltf" else set()
        found = [entry for entry in self.path.parent.iterdir() if entry.name in names or entry.name.startswith(f"{stem}_world.")]
        return all(file in self._earlier for entry in found for file in (entry.rglob("*") if entry.is_dir() else [entry]))


def _stems(stem: str) -> Iterator[str]:
    """The names that the files beside a glTF may have, in order of preference."""
    yield stem
    for number in itertools.count(2):
        yield f"{stem}-{number}"


def _files_of(path: Path) -> set[Path]:
    """The files beside a glTF to which it refers, if an export of ours made it."""
    try:
        root = _json_of(path)
        extras = root["scenes"][0]["extras"]["buzz"]
        if not extras["generator"].startswith(GENERATOR):
            return set()
        uris = [item.get("uri", "") for item in (*root.get("buffers", []), *root.get("images", []))]
        uris.append(extras.get("world", {}).get("image", ""))
        names = [unquote(uri) for uri in uris]
    except (OSError, ValueError, LookupError, TypeError, AttributeError, struct.error):
        return set()
    ours = re.compile(re.escape(path.stem) + r"(-\d+)?(\.bin|_world\.\w+|_textures/[^/\\]+)")
    return {file for name in names if ours.fullmatch(name) and (file := path.parent / name).is_file()}


def _json_of(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        head = file.read(20)
        if head[:4] != b"glTF":
            return json.loads(head + file.read())
        return json.loads(file.read(struct.unpack_from("<I", head, 12)[0]))
