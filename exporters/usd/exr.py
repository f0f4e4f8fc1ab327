"""OpenEXR images, by the package OpenEXR, which reads and writes files only."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

MAGIC = b"\x76\x2f\x31\x01"


def rgba(data: bytes) -> np.ndarray:
    """An image's pixels; the grey of all three colours where it has Y alone. KeyError where it has neither."""
    channels = _channels(data)
    first = channels["R" if "R" in channels else "Y"]
    planes = [*(channels.get(c, first) for c in "RGB"), channels.get("A", np.ones_like(first))]
    return np.nan_to_num(np.stack(planes, axis=2).astype(np.float32))


def coloured(data: bytes) -> bytes:
    """An image with R, G and B: itself, or what is made of its Y. KeyError where it has neither."""
    import OpenEXR

    with _on_disk(data) as path:
        with OpenEXR.File(path, header_only=True) as image:
            names = {c.name for c in image.header()["channels"]}
        if names.issuperset("RGB"):
            return data
        grey = _channels(data)["Y"]
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, dict.fromkeys("RGB", grey)) as image:
            image.write(path)
        return Path(path).read_bytes()


def _channels(data: bytes) -> dict[str, np.ndarray]:
    import OpenEXR

    with _on_disk(data) as path, OpenEXR.File(path, separate_channels=True) as image:
        return {name: np.array(channel.pixels) for name, channel in image.channels().items()}


@contextlib.contextmanager
def _on_disk(data: bytes) -> Iterator[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "image.exr"
        path.write_bytes(data)
        yield str(path)
