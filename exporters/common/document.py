"""A glTF document as plain JSON and one binary buffer: read, extended, written.

Blender's Python has no glTF library, so patching what its exporter wrote is done on the JSON itself; that also keeps
every extension and extra it does not know. The layouts are those of the glTF 2.0 specification, sections 3.6
(buffers, accessors) and 4 (GLB).
"""

from __future__ import annotations

import base64
import json
import os
import secrets
import struct
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np

from .report import InputError, OutputError

_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_COMPONENTS = {"float32": 5126, "uint8": 5121, "uint16": 5123, "uint32": 5125}
_GLB_MAGIC, _JSON_CHUNK, _BIN_CHUNK = 0x46546C67, 0x4E4F534A, 0x004E4942

ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963


class Document:
    """JSON plus one buffer; indices returned by the `add` methods are glTF indices."""

    def __init__(self, root: dict[str, Any] | None = None, binary: bytes = b"") -> None:
        self.root: dict[str, Any] = root or {"asset": {"version": "2.0"}}
        self.binary = bytearray(binary)
        self._cache: dict[tuple[bytes, str, str, int | None], int] = {}

    @classmethod
    def load(cls, path: Path) -> Document:
        """Read `.gltf` or `.glb`; all buffers become one."""
        try:
            raw = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: {error.strerror}") from error
        chunk = b""
        try:
            if raw[:4] == b"glTF":
                (length,) = struct.unpack_from("<I", raw, 12)
                text = raw[20 : 20 + length]
                if len(raw) > 20 + length:
                    (size,) = struct.unpack_from("<I", raw, 20 + length)
                    chunk = raw[28 + length : 28 + length + size]
            else:
                text = raw
            root = json.loads(text)
        except (struct.error, ValueError) as error:
            raise InputError(f"{path}: not a glTF file ({error})") from error
        document = cls(root)
        document._gather_buffers(path.parent, chunk)
        return document

    def _gather_buffers(self, folder: Path, chunk: bytes) -> None:
        """Append every buffer to `binary` and point the views there."""
        starts = []
        for buffer in self.root.get("buffers", []):
            uri = buffer.get("uri")
            if uri is None:
                data = chunk
            elif uri.startswith("data:"):
                data = base64.b64decode(uri.split(",", 1)[1])
            else:
                data = (folder / unquote(uri)).read_bytes()
            self._pad()
            starts.append(len(self.binary))
            self.binary += data[: buffer["byteLength"]]
        for view in self.root.get("bufferViews", []):
            view["byteOffset"] = view.get("byteOffset", 0) + starts[view["buffer"]]
            view["buffer"] = 0
        self.root.pop("buffers", None)

    def _pad(self) -> None:
        self.binary += b"\0" * (-len(self.binary) % 4)

    def list(self, key: str) -> list[Any]:
        """The top-level array `key`, made if it is not there."""
        return self.root.setdefault(key, [])

    def append(self, key: str, value: Any) -> int:
        """Append to the top-level array `key`; the new index."""
        items = self.list(key)
        items.append(value)
        return len(items) - 1

    def use_extension(self, name: str) -> None:
        """Name an extension in `extensionsUsed`: optional, so that readers without it open the file."""
        used = self.list("extensionsUsed")
        if name not in used:
            used.append(name)

    def add_view(self, data: bytes, target: int | None = None) -> int:
        """Store bytes; the index of their view."""
        self._pad()
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self.binary += data
        return self.append("bufferViews", view)

    def add_accessor(self, values: np.ndarray, target: int | None = None, limits: bool = False) -> int:
        """Store an array (rows are elements); equal arrays share one accessor."""
        values = np.ascontiguousarray(values)
        if values.dtype == np.float64:
            values = values.astype(np.float32)
        width = 1 if values.ndim == 1 else values.shape[1]
        data = values.tobytes()
        key = (data, values.dtype.name, f"{width}{limits}", target)
        if key in self._cache:
            return self._cache[key]
        accessor: dict[str, Any] = {
            "bufferView": self.add_view(data, target),
            "componentType": _COMPONENTS[values.dtype.name],
            "count": len(values),
            "type": _TYPES[width],
        }
        if limits:
            rows = values.reshape(len(values), width)
            accessor["min"] = [_number(x) for x in rows.min(axis=0)]
            accessor["max"] = [_number(x) for x in rows.max(axis=0)]
        index = self.append("accessors", accessor)
        self._cache[key] = index
        return index

    def buffer(self) -> bytes:
        """The binary buffer as it stands in a file."""
        self._pad()
        return bytes(self.binary)

    def text(self, binary: str = "") -> bytes:
        """The JSON, with the name of the file that holds the buffer; none inside a GLB."""
        root = {k: v for k, v in self.root.items() if v not in ([], {})}
        if self.binary:
            root["buffers"] = [{"byteLength": len(self.buffer())} | ({"uri": quote(binary)} if binary else {})]
        return json.dumps(root, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()

    def packed(self) -> bytes:
        """All of it as a GLB."""
        text = self.text()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), _JSON_CHUNK) + text
        if self.binary:
            chunks += struct.pack("<II", len(self.binary), _BIN_CHUNK) + self.buffer()
        return struct.pack("<III", _GLB_MAGIC, 2, 12 + len(chunks)) + chunks

    def save(self, path: Path) -> list[Path]:
        """Write `.glb` or `.gltf` + `.bin`, each whole or not at all; the files written."""
        if path.suffix == ".glb":
            write_whole(path, self.packed())
            return [path]
        binary = path.with_suffix(".bin")
        if self.binary:
            write_whole(binary, self.buffer())
        write_whole(path, self.text(binary.name))
        return [path, binary] if self.binary else [path]


def _number(x: Any) -> int | float:
    """A numpy scalar as JSON writes it."""
    return x.item()


def write_whole(path: Path, data: bytes) -> None:
    """Write beside, to disk, and rename: no reader ever sees half a file, and what fails leaves none."""
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise OutputError(f"{path}: cannot be written ({error.strerror}); choose another output folder") from error
