"""Texture files: found through USD's asset resolver (also inside .usdz), copied as they are where glTF can take them so.

glTF wants certain things in certain channels (metallic in B, roughness in G, alpha in A); where a stage has them
elsewhere, a new PNG is made with Pillow.
"""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import quote

import numpy as np
from PIL import Image, UnidentifiedImageError
from pxr import Ar, Sdf

from ..common.document import Document
from ..common.report import Lost
from ..common.srgb import decoded, encoded
from . import exr
from .output import Output

_DIRECT = {"PNG": ".png", "JPEG": ".jpg"}
# Where a PNG says how many bits a channel has.
_PNG_DEPTH = 24
_ONE, _NOTHING = (1.0,) * 4, (0.0,) * 4


@dataclass(frozen=True)
class Channel:
    """One channel (r, g, b, a) or all (rgb) of an asset, made linear as `space` says, times scale plus bias."""

    asset: str
    output: str
    scale: tuple[float, ...] = _ONE
    bias: tuple[float, ...] = _NOTHING
    space: str = "auto"


def open_asset(resolved: str) -> bytes | None:
    """The bytes of a resolved asset path, inside a package too; None if there are none."""
    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(resolved)) if resolved else None
    # A file of no bytes has no buffer.
    buffer = asset.GetBuffer() if asset else None
    return bytes(buffer) if buffer else None


class Textures:
    """Images of one export; each distinct content is written once. A `colour` is sRGB-coded in glTF, anything else is not."""

    def __init__(self, document: Document, output: Output, lost: Lost) -> None:
        self.document, self.output, self.lost = document, output, lost
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
        """RGBA as stored (not linearised), rows from the top; whole numbers as 0-1."""
        if asset not in self._pixels:
            data = self.raw(asset, path)
            try:
                if data and data[:4] == exr.MAGIC:
                    self._pixels[asset] = exr.rgba(data)
                else:
                    self._pixels[asset] = _image_pixels(data) if data else None
            except (UnidentifiedImageError, OSError, ImportError, KeyError, RuntimeError):
                self.lost.add(path, f"texture {asset} is in a format that cannot be read", "save it as PNG")
                self._pixels[asset] = None
        return self._pixels[asset]

    def _coded(self, channel: Channel, colour: bool) -> bool:
        """Whether the file's values are sRGB-coded, by the rules of UsdUVTexture's sourceColorSpace.

        Its `auto` would decode any 8-bit RGB image; for data nobody means that, and many exporters leave it at `auto`.
        """
        if channel.space != "auto":
            return channel.space == "sRGB"
        return colour and _eight_bit_colour(self._raw[channel.asset])

    def _plane(self, channel: Channel, path: str, colour: bool) -> np.ndarray | None:
        """One channel as a shader reads it: linear, scaled, biased."""
        pixels = self.pixels(channel.asset, path)
        if pixels is None:
            return None
        c = "rgba".index(channel.output[0])
        values = decoded(pixels[..., c]) if c < 3 and self._coded(channel, colour) else pixels[..., c]
        return values * channel.scale[c] + channel.bias[c]

    def top(self, channel: Channel, path: str) -> float:
        """The largest value of a colour, at least 1."""
        if channel.bias == _NOTHING and channel.scale == _ONE and _format(self.raw(channel.asset, path)) in _DIRECT:
            return 1.0
        planes = [self._plane(replace(channel, output=c), path, colour=True) for c in channel.output]
        return max([1.0, *(float(p.max()) for p in planes if p is not None)])

    def copied(self, channel: Channel, path: str, wrap: tuple[int, int], colour: bool = False) -> int | None:
        """The glTF texture of a whole file, without the channel's scale and bias; unchanged where it is PNG or JPEG coded as glTF's are."""
        data = self.raw(channel.asset, path)
        if data is None:
            return None
        kind = _format(data)
        if kind in _DIRECT and self._coded(channel, colour) == colour:
            return self._texture(data, _DIRECT[kind], channel.asset, wrap)
        return self.packed({i: Channel(channel.asset, c, space=channel.space) for i, c in enumerate("rgba")}, path, wrap, channel.asset, colour)

    def packed(self, parts: dict[int, Channel | float], path: str, wrap: tuple[int, int], name: str, colour: bool = False) -> int | None:
        """A new texture whose channel numbers 0-3 come from the channels or constants given; others are 1."""
        planes: dict[int, np.ndarray | float] = {}
        for number, part in parts.items():
            if isinstance(part, Channel):
                # Alpha is no colour, whichever channel it comes from.
                plane = self._plane(part, path, colour and number < 3)
                if plane is None:
                    return None
                if colour and number < 3:
                    if plane.max() > 1.001:
                        self.lost.add(path, f"colours over 1 in {Path(part.asset).name}", "they are cut off at 1; scale the image down")
                    plane = encoded(plane)
                planes[number] = np.clip(plane, 0, 1)
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
        planes = [self._plane(replace(channel, output=c), path, colour=False) for c in "rgb"]
        if planes[0] is None:
            return None
        n = np.stack(planes, axis=2)
        out = np.ones((*n.shape[:2], 4), dtype=np.float32)
        out[..., :3] = n / np.maximum(np.linalg.norm(n, axis=2, keepdims=True), 1e-6) * 0.5 + 0.5
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
        if self.output.target.suffix == ".glb":
            mime = "image/png" if suffix == ".png" else "image/jpeg"
            return self.document.append("images", {"name": base, "mimeType": mime, "bufferView": self.document.add_view(data)})
        number = len(self.document.list("images"))
        file = self.output.add(f"{self.output.target.stem}_textures/{base}_{number}", suffix, data)
        return self.document.append("images", {"name": base, "uri": quote(file)})


def _format(data: bytes | None) -> str | None:
    """What Pillow calls a file's format; None for what it does not know."""
    try:
        return Image.open(io.BytesIO(data)).format if data else None
    except (UnidentifiedImageError, OSError):
        return None


def _eight_bit_colour(data: bytes) -> bool:
    """Whether a file has three or four channels of 8 bits."""
    if _format(data) is None:
        return False
    deep = data[1:4] == b"PNG" and data[_PNG_DEPTH] == 16
    return not deep and Image.open(io.BytesIO(data)).mode in ("RGB", "RGBA", "P", "CMYK", "YCbCr")


def _image_pixels(data: bytes) -> np.ndarray:
    """RGBA of what Pillow reads."""
    image = Image.open(io.BytesIO(data))
    if image.mode[0] not in "IF":
        return np.asarray(image.convert("RGBA"), dtype=np.float32) / 255
    # 16-bit and float greys, which Pillow would cut off at 255.
    grey = np.asarray(image, dtype=np.float32) / (65535 if image.mode[0] == "I" else 1)
    return np.stack([grey, grey, grey, np.ones_like(grey)], axis=2)


def _resized(plane: np.ndarray, width: int, height: int) -> np.ndarray:
    if plane.shape == (height, width):
        return plane
    image = Image.fromarray(plane.astype(np.float32), mode="F").resize((width, height), Image.Resampling.BILINEAR)
    return np.asarray(image)


def resolved_path(attribute_value: Sdf.AssetPath) -> str:
    """The resolved path of an asset value, or what was written if nothing resolves."""
    return attribute_value.resolvedPath or attribute_value.path
