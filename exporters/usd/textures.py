"""Texture files: found through USD's asset resolver (also inside .usdz), copied as they are where glTF can take them so.

glTF wants certain things in certain channels (metallic in B, roughness in G, alpha in A); where a stage has them
elsewhere, a new PNG is made with Pillow.
"""

from __future__ import annotations

import hashlib
import io
import tempfile
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np
from PIL import Image, UnidentifiedImageError
from pxr import Ar, Sdf

from ..common.document import Document, write_whole
from ..common.report import Lost

_EXR_MAGIC = b"\x76\x2f\x31\x01"
_DIRECT = {"PNG": ".png", "JPEG": ".jpg"}


@dataclass(frozen=True)
class Channel:
    """One channel (r, g, b, a) or all (rgb) of an asset, times scale plus bias."""

    asset: str
    output: str
    scale: tuple[float, ...] = (1, 1, 1, 1)
    bias: tuple[float, ...] = (0, 0, 0, 0)


def open_asset(resolved: str) -> bytes | None:
    """The bytes of a resolved asset path, inside a package too."""
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
    if not asset:
        return None
    return bytes(asset.GetBuffer())


class Textures:
    """Images of one export; each distinct content is written once."""

    def __init__(self, document: Document, target: Path, lost: Lost) -> None:
        self.document, self.target, self.lost = document, target, lost
        self._images: dict[bytes, int] = {}
        self._textures: dict[tuple, int] = {}
        self._raw: dict[str, bytes | None] = {}
        self._pixels: dict[str, np.ndarray | None] = {}

    def raw(self, asset: str, path: str) -> bytes | None:
        """A texture file's bytes; a missing one is named once."""
        if asset not in self._raw:
            self._raw[asset] = open_asset(asset)
            if self._raw[asset] is None:
                self.lost.add(path, f"texture {asset or '(empty path)'} is missing", "its fallback colour is used; check the path")
        return self._raw[asset]

    def pixels(self, asset: str, path: str) -> np.ndarray | None:
        """RGBA in 0-1 as stored (not linearised), rows from the top."""
        if asset not in self._pixels:
            data = self.raw(asset, path)
            try:
                if data and data[:4] == _EXR_MAGIC:
                    self._pixels[asset] = _exr_pixels(data)
                    return self._pixels[asset]
                image = Image.open(io.BytesIO(data)) if data else None
                self._pixels[asset] = np.asarray(image.convert("RGBA"), dtype=np.float32) / 255 if image else None
            except (UnidentifiedImageError, OSError, ImportError, KeyError, RuntimeError):
                self.lost.add(path, f"texture {asset} is in a format that cannot be read", "save it as PNG")
                self._pixels[asset] = None
        return self._pixels[asset]

    def copied(self, asset: str, path: str, wrap: tuple[int, int]) -> int | None:
        """The glTF texture of an asset, unchanged where it is PNG or JPEG."""
        data = self.raw(asset, path)
        if data is None:
            return None
        try:
            kind = Image.open(io.BytesIO(data)).format
        except (UnidentifiedImageError, OSError):
            kind = None
        if kind in _DIRECT:
            return self._texture(data, _DIRECT[kind], asset, wrap)
        pixels = self.pixels(asset, path)
        return None if pixels is None else self._made(pixels, asset, wrap)

    def packed(self, parts: dict[int, Channel | float], path: str, wrap: tuple[int, int], name: str) -> int | None:
        """A new texture whose channel numbers 0-3 come from the channels or constants given; others are 1."""
        planes: dict[int, np.ndarray | float] = {}
        for number, part in parts.items():
            if isinstance(part, Channel):
                pixels = self.pixels(part.asset, path)
                if pixels is None:
                    return None
                c = "rgba".index(part.output[0])
                planes[number] = np.clip(pixels[..., c] * part.scale[c] + part.bias[c], 0, 1)
            else:
                planes[number] = part
        height = max(p.shape[0] for p in planes.values() if isinstance(p, np.ndarray))
        width = max(p.shape[1] for p in planes.values() if isinstance(p, np.ndarray))
        out = np.ones((height, width, 4), dtype=np.float32)
        for number, plane in planes.items():
            out[..., number] = _resized(plane, width, height) if isinstance(plane, np.ndarray) else plane
        return self._made(out, name, wrap)

    def normal(self, channel: Channel, path: str, wrap: tuple[int, int]) -> int | None:
        """A normal map brought to glTF's coding: colour * 2 - 1, green up."""
        pixels = self.pixels(channel.asset, path)
        if pixels is None:
            return None
        n = pixels[..., :3] * np.array(channel.scale[:3]) + np.array(channel.bias[:3])
        n /= np.maximum(np.linalg.norm(n, axis=2, keepdims=True), 1e-6)
        out = np.ones_like(pixels)
        out[..., :3] = n * 0.5 + 0.5
        return self._made(out, channel.asset, wrap)

    def _made(self, pixels: np.ndarray, name: str, wrap: tuple[int, int]) -> int:
        data = np.clip(np.round(pixels * 255), 0, 255).astype(np.uint8)
        image = Image.fromarray(data if (data[..., 3] < 255).any() else data[..., :3])
        buffer = io.BytesIO()
        image.save(buffer, "PNG")
        return self._texture(buffer.getvalue(), ".png", name, wrap)

    def _texture(self, data: bytes, suffix: str, name: str, wrap: tuple[int, int]) -> int:
        digest = hashlib.blake2b(data, digest_size=16).digest()
        if digest not in self._images:
            self._images[digest] = self._image(data, suffix, name)
        key = (self._images[digest], wrap)
        if key not in self._textures:
            sampler = {"magFilter": 9729, "minFilter": 9987, "wrapS": wrap[0], "wrapT": wrap[1]}
            samplers = self.document.list("samplers")
            if sampler not in samplers:
                samplers.append(sampler)
            texture = {"source": self._images[digest], "sampler": samplers.index(sampler)}
            self._textures[key] = self.document.append("textures", texture)
        return self._textures[key]

    def _image(self, data: bytes, suffix: str, name: str) -> int:
        base = Path(Ar.SplitPackageRelativePathInner(name)[1] or name if "[" in name else name).stem or "texture"
        base = "".join(c if c.isalnum() or c in "-_" else "_" for c in base)
        if self.target.suffix == ".glb":
            mime = "image/png" if suffix == ".png" else "image/jpeg"
            return self.document.append("images", {"name": base, "mimeType": mime, "bufferView": self.document.add_view(data)})
        folder = f"{self.target.stem}_textures"
        number = len(self.document.list("images"))
        file = f"{base}_{number}{suffix}"
        write_whole(self.target.parent / folder / file, data)
        return self.document.append("images", {"name": base, "uri": quote(f"{folder}/{file}")})


def _exr_pixels(data: bytes) -> np.ndarray:
    """An OpenEXR image, which is linear, as sRGB-encoded RGBA in 0-1; what is over 1 is cut off."""
    import OpenEXR

    with tempfile.NamedTemporaryFile(suffix=".exr") as file:
        file.write(data)
        file.flush()
        with OpenEXR.File(file.name, separate_channels=True) as image:
            channels = {k: np.asarray(c.pixels, dtype=np.float32) for k, c in image.channels().items()}
    first = channels.get("R", channels.get("Y"))
    if first is None:
        raise KeyError("R")
    rgb = np.stack([channels.get(c, first) for c in "RGB"], axis=2)
    rgb = np.clip(rgb, 0, 1)
    encoded = np.where(rgb <= 0.0031308, rgb * 12.92, 1.055 * np.maximum(rgb, 1e-9) ** (1 / 2.4) - 0.055)
    alpha = channels.get("A", np.ones_like(first))
    return np.concatenate([encoded, np.clip(alpha, 0, 1)[..., None]], axis=2).astype(np.float32)


def _resized(plane: np.ndarray, width: int, height: int) -> np.ndarray:
    if plane.shape == (height, width):
        return plane
    image = Image.fromarray(plane.astype(np.float32), mode="F").resize((width, height), Image.Resampling.BILINEAR)
    return np.asarray(image)


def resolved_path(attribute_value: Sdf.AssetPath) -> str:
    """The resolved path of an asset value, or what was written if nothing resolves."""
    return attribute_value.resolvedPath or attribute_value.path
