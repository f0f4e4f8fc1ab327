"""The files of one export: made beside their place and moved there together; files of anyone else's are left alone.

The ones to replace are those that the glTF file of the export before refers to.
"""

from __future__ import annotations

import itertools
import os
import shutil
import tempfile
from pathlib import Path

from ..common.document import Document
from ..common.files import files_of_earlier, put_in_place, remove_if_empty, unwritable


class Output:
    """A context manager: what has not been finished leaves nothing."""

    def __init__(self, target: Path) -> None:
        self.target = target
        self._own = files_of_earlier(target)
        self._ready: dict[Path, Path] = {}

    def __enter__(self) -> Output:
        folder = self.target.parent
        self._folders = [p for p in (folder, *folder.parents) if not p.exists()]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._beside = Path(tempfile.mkdtemp(prefix=f".{self.target.stem}.", suffix=".tmp", dir=folder))
        except OSError as error:
            raise unwritable(folder, error) from error
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._beside, ignore_errors=True)
        for folder in self._folders:
            remove_if_empty(folder)

    def add(self, name: str, suffix: str, data: bytes) -> str:
        """Take in a file beside the target; its name, with a number where somebody's file has that name."""
        names = (f"{name}{number}{suffix}" for number in itertools.chain([""], (f"-{n}" for n in itertools.count(2))))
        file = next(n for n in names if self._is_free(self.target.parent / n))
        self._write(self.target.parent / file, data)
        return file

    def _is_free(self, path: Path) -> bool:
        return path not in self._ready and (path in self._own or not os.path.lexists(path))

    def finish(self, document: Document) -> None:
        """Write the document and move all files to their places, the target last."""
        if self.target.suffix == ".glb":
            self._write(self.target, document.packed())
        else:
            binary = self.add(self.target.stem, ".bin", document.buffer()) if document.binary else ""
            self._write(self.target, document.text(binary))
        put_in_place([(made, path) for path, made in self._ready.items()], self._own, self._beside)

    def _write(self, path: Path, data: bytes) -> None:
        made = self._beside / str(len(self._ready))
        try:
            with made.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise unwritable(path, error) from error
        self._ready[path] = made
