"""The texture nodes of a material (UsdUVTexture, UsdTransform2d, UsdPrimvarReader), read for one input of its surface.

Sources: the UsdPreviewSurface specification (texture reader, transform 2d) and KHR_texture_transform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdShade

from ..common.extras import tidy
from ..common.report import Lost
from .textures import Channel, resolved_path

_WRAP = {"repeat": 10497, "mirror": 33648, "clamp": 33071, "black": 33071, "useMetadata": 10497}
_BLACK_FALLBACK = (0.0, 0.0, 0.0, 1.0)
# What a UsdUVTexture gives; rgba is no output of the specification's, but written by some.
OUTPUTS = {"rgb": "rgb", "r": "r", "g": "g", "b": "b", "a": "a", "rgba": "rgb"}
# glTF counts v from the top.
_TURNED_OVER = np.array([[1, 0, 0], [0, -1, 1], [0, 0, 1]], float)


@dataclass
class Reader:
    """A UsdUVTexture as one input sees it."""

    channel: Channel
    wrap: tuple[int, int]
    st: str
    transform: dict[str, Any] | None
    fallback: tuple[float, ...]

    def placed_as(self, other: Reader) -> bool:
        """Whether both images lie on the surface in the same way."""
        return (self.wrap, self.st, self.transform) == (other.wrap, other.st, other.transform)


def fits(value: Any, default: Any) -> bool:
    """Whether a value is as many numbers as a default is."""
    try:
        return np.asarray(value, dtype=float).shape == np.shape(default)
    except (TypeError, ValueError):
        return False


class Readers:
    """Reads the nodes of one material, which `path` names, at one time."""

    def __init__(self, path: str, time: Usd.TimeCode, lost: Lost) -> None:
        self.path, self.time, self.lost = path, time, lost

    def constant(self, shader: UsdShade.Shader, name: str) -> Any:
        """The value of an input that is not connected to a node; None without one."""
        found = shader.GetInput(name)
        for attribute in UsdShade.Utils.GetValueProducingAttributes(found) if found else ():
            if UsdShade.Utils.GetType(attribute.GetName()) != UsdShade.AttributeType.Output:
                return self.at_first_frame(attribute, name)
        return None

    def value(self, shader: UsdShade.Shader, name: str, default: Any) -> Any:
        """The same with a default, which also stands for what is no constant of the default's kind."""
        found = shader.GetInput(name)
        value = self.constant(shader, name)
        if value is None and found and found.HasConnectedSource():
            self.lost.add(self.path, f"{name} from a node", "only a constant is carried; its default is used")
        return self.fitting(value, name, default)

    def fitting(self, value: Any, name: str, default: Any) -> Any:
        """A value as it is, or the default where it has not as many numbers."""
        if value is None:
            return default
        if isinstance(default, str) or default is None or fits(value, default):
            return value
        self.lost.add(self.path, f"{name} of a wrong type", "its default is used; check the material with usdchecker")
        return default

    def at_first_frame(self, attribute: Usd.Attribute, name: str) -> Any:
        """A value that glTF cannot animate, as it is at the start."""
        if attribute.ValueMightBeTimeVarying():
            self.lost.add(self.path, f"animated {name}", "the value of the first frame is used")
        return attribute.Get(self.time)

    def texture(self, node: UsdShade.Shader, output: str) -> Reader:
        """The texture node as seen through one of its outputs."""
        name = self._file(node)
        scale = tuple(float(x) for x in self.value(node, "scale", (1, 1, 1, 1)))
        bias = tuple(float(x) for x in self.value(node, "bias", (0, 0, 0, 0)))
        space = str(self.value(node, "sourceColorSpace", "auto"))
        modes = [str(self.value(node, key, "useMetadata")) for key in ("wrapS", "wrapT")]
        if "black" in modes:
            self.lost.add(self.path, "wrap mode black", "its border colour goes on instead; put a black border into the image")
        wrap = (_WRAP.get(modes[0], 10497), _WRAP.get(modes[1], 10497))
        st, transform = self._coordinates(node)
        fallback = tuple(float(x) for x in self.value(node, "fallback", _BLACK_FALLBACK))
        return Reader(Channel(name, output, scale, bias, space), wrap, st, transform, fallback)

    def _file(self, node: UsdShade.Shader) -> str:
        """The resolved path of a texture's file; of UDIM tiles the first one's."""
        asset = self.value(node, "file", None)
        if not isinstance(asset, Sdf.AssetPath):
            return ""
        if not UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            return resolved_path(asset)
        attribute = UsdShade.Utils.GetValueProducingAttributes(node.GetInput("file"))[0]
        tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, attribute.GetPropertyStack(self.time)[0].layer)
        if tiles and [tile for _, tile in tiles] != ["1001"]:
            self.lost.add(self.path, "UDIM texture", "its first tile is used everywhere; bake the tiles into one image")
        return tiles[0][0] if tiles else asset.path

    def _coordinates(self, node: UsdShade.Shader) -> tuple[str, dict[str, Any] | None]:
        """Name of the primvar a texture reads, and all UsdTransform2d on the way to it as one KHR_texture_transform."""
        whole, found, name = np.eye(3), False, "st"
        current, met = node.GetInput("st"), set()
        while current:
            attributes = UsdShade.Utils.GetValueProducingAttributes(current)
            source = UsdShade.Shader(attributes[0].GetPrim()) if attributes else None
            kind = source.GetIdAttr().Get() if source else None
            if kind == "UsdTransform2d" and source.GetPath() not in met:
                met.add(source.GetPath())
                # The nodes are met from the texture backwards: the last one met is applied first.
                whole, found = whole @ self._transform(source), True
                current = source.GetInput("in")
                continue
            if kind and kind.startswith("UsdPrimvarReader"):
                name = str(self.value(source, "varname", "st"))
            elif kind:
                what = "circle of nodes" if source.GetPath() in met else f"{kind} node"
                self.lost.add(self.path, f"texture coordinates from a {what}", "the primvar st is used; connect them to a UsdPrimvarReader_float2")
            break
        return name, self._turned_over(whole) if found else None

    def _transform(self, node: UsdShade.Shader) -> np.ndarray:
        """A UsdTransform2d as a matrix: scaled, then turned, then moved."""
        angle = math.radians(float(self.value(node, "rotation", 0.0)))
        (sx, sy), (tx, ty) = self.value(node, "scale", (1, 1)), self.value(node, "translation", (0, 0))
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c * sx, -s * sy, tx], [s * sx, c * sy, ty], [0, 0, 1]])

    def _turned_over(self, matrix: np.ndarray) -> dict[str, Any]:
        """A matrix for v from the bottom as KHR_texture_transform, whose v comes from the top, and whose rotation turns as the image is seen."""
        m = _TURNED_OVER @ matrix @ _TURNED_OVER
        u, v = m[:2, 0], m[:2, 1]
        if abs(u @ v) > 1e-6 * np.linalg.norm(u) * np.linalg.norm(v):
            self.lost.add(self.path, "texture transforms that shear together", "the image is not sheared; turn it before it is scaled unevenly")
        angle = math.atan2(-u[1], u[0]) if u.any() else math.atan2(v[0], v[1])
        height = v @ (math.sin(angle), math.cos(angle))
        return {"offset": [tidy(x) for x in m[:2, 2]], "rotation": tidy(angle), "scale": [tidy(np.linalg.norm(u)), tidy(height)]}
