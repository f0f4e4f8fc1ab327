"""The files of one export: made beside their place and moved there together; files of anyone else's are left alone.

The ones to replace are those that the glTF file of the export before refers to.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import re
import shutil
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import pygltflib

from ..common.document import Document
from ..common.report import OutputError

_GLB_HEADER = struct.Struct("<4s4I")


class Output:
    """A context manager: what has not been finished leaves nothing."""

    def __init__(self, target: Path) -> None:
        self.target = target
        self._own = _files_of(target)
        self._ready: dict[Path, Path] = {}

    def __enter__(self) -> Output:
        folder = self.target.parent
        self._folders = [p for p in (folder, *folder.parents) if not p.exists()]
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._beside = Path(tempfile.mkdtemp(prefix=f".{self.target.stem}.", suffix=".tmp", dir=folder))
        except OSError as error:
            raise _unwritable(folder, error) from error
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._beside, ignore_errors=True)
        for folder in self._folders:
            _remove_if_empty(folder)

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
        root = {k: v for k, v in document.root.items() if v not in ([], {})}
        as_text = self.target.suffix == ".gltf"
        if document.binary:
            root["buffers"] = [{"byteLength": len(document.binary)}]
            if as_text:
                root["buffers"][0]["uri"] = quote(self.add(self.target.stem, ".bin", bytes(document.binary)))
        gltf = pygltflib.GLTF2.from_json(json.dumps(root))
        if as_text:
            self._write(self.target, gltf.gltf_to_json(separators=(",", ":"), indent=None).encode())
        else:
            gltf.set_binary_blob(bytes(document.binary))
            self._write(self.target, b"".join(gltf.save_to_bytes()))
        self._move()
        for path in self._own - set(self._ready):
            with contextlib.suppress(OSError):
                path.unlink()
            if path.parent != self.target.parent:
                _remove_if_empty(path.parent)

    def _write(self, path: Path, data: bytes) -> None:
        made = self._beside / str(len(self._ready))
        try:
            with made.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise _unwritable(path, error) from error
        self._ready[path] = made

    def _move(self) -> None:
        with contextlib.ExitStack() as undo:
            for path, made in self._ready.items():
                try:
                    if not path.parent.is_dir():
                        path.parent.mkdir()
                        undo.callback(_remove_if_empty, path.parent)
                    if path != self.target:
                        undo.callback(_set_aside(path, made.with_suffix(".old")))
                    os.replace(made, path)
                except OSError as error:
                    raise _unwritable(path, error) from error
            undo.pop_all()


def _set_aside(path: Path, old: Path) -> Callable[[], None]:
    """Move a file away, if it is there; what brings back how it was."""
    if not os.path.lexists(path):
        return lambda: path.unlink(missing_ok=True)
    os.replace(path, old)
    return lambda: os.replace(old, path)


def _remove_if_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):
        folder.rmdir()


def _unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: cannot be written ({error.strerror}); choose another output folder")


def _files_of(target: Path) -> set[Path]:
    """The file of the export before and those it refers to; nothing where there is none."""
    try:
        root = _json(target)
        buzz = root["scenes"][0]["extras"]["buzz"]
        made_here = buzz["generator"].startswith("Buzz ")
        names = [item.get("uri", "") for key in ("images", "buffers") for item in root.get(key, [])]
        names.append((buzz.get("world") or {}).get("image", ""))
    except FileNotFoundError:
        return set()
    except OSError as error:
        raise _unwritable(target, error) from error
    except (ValueError, LookupError, TypeError, AttributeError, struct.error):
        made_here = False
    # The target itself was named by whoever exports; what another program put beside it was not.
    if not made_here:
        return {target}
    # Whatever else a file refers to was put there by hand.
    ours = re.compile(rf"{re.escape(target.stem)}(-\d+)?(_textures/[^/\\]+\.(png|jpg)|_world(-\d+)?\.\w+|\.bin)")
    paths = (target.parent / unquote(n) for n in names if ours.fullmatch(unquote(n)))
    return {target, *(p for p in paths if p.is_file())}


def _json(path: Path) -> Any:
    """The JSON of a .gltf or .glb file."""
    with path.open("rb") as file:
        if path.suffix == ".gltf":
            return json.load(file)
        length = _GLB_HEADER.unpack(file.read(_GLB_HEADER.size))[3]
        return json.loads(file.read(length))
