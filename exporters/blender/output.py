"""The files of one export: made in a folder of their own, then put in place together, or not at all.

Of what is already there, only files that an earlier export to the same path refers to are replaced. Where anything else
stands in the way, the files beside the glTF take another name.
"""

from __future__ import annotations

import errno
import itertools
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ..common.document import Document
from ..common.files import files_of_earlier, put_in_place, remove_if_empty, unwritable
from ..common.report import OutputError

GENERATOR = "Buzz exporter for Blender"


class Output:
    """Where an export is made (`folder`, under the name `stem`), and where it goes (`path`)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.suffix not in (".gltf", ".glb"):
            raise OutputError(f"{path}: the name must end in .gltf or .glb")
        self._earlier = files_of_earlier(path)
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
        new = [(file, self.path.parent / file.relative_to(self.folder)) for file in beside]
        put_in_place([*new, (gltf, self.path)], self._earlier, self.folder)

    def discard(self) -> None:
        """Remove what is not in place, and folders that were made for nothing."""
        shutil.rmtree(self.folder, ignore_errors=True)
        for folder in self._new_folders:
            remove_if_empty(folder)

    def error(self, error: OSError) -> OutputError:
        """The line for a file that could not be written."""
        return unwritable(self.path, error)

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
