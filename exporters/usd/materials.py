"""UsdPreviewSurface to glTF materials; MaterialX surfaces by their constants where a stage has nothing else.

Source: the UsdPreviewSurface specification. Texture nodes are read by readers.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdShade

from ..common.document import Document
from ..common.extras import tidy
from ..common.report import Lost
from .readers import OUTPUTS, Reader, Readers, fits
from .textures import Channel, Textures

# MaterialX has the same surface under its own name.
_PREVIEWS = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")
# What vertex colours, which multiply glTF's base colour, can stand for.
_VERTEX_COLOURS = {"diffuseColor": "displayColor", "opacity": "displayOpacity"}

# MaterialX surfaces without a UsdPreviewSurface beside them: input names for what glTF has.
_MATERIALX = {
    "ND_standard_surface_surfaceshader": ("base_color", "metalness", "specular_roughness", "specular_IOR", "transmission", "base"),
    "ND_open_pbr_surface_surfaceshader": ("base_color", "base_metalness", "specular_roughness", "specular_ior", "transmission_weight", "base_weight"),
    "ND_gltf_pbr_surfaceshader": ("base_color", "metallic", "roughness", "ior", "transmission", ""),
}


def bound_material(prim: Usd.Prim) -> UsdShade.Material:
    """What is bound to a prim for final pictures, else for all purposes; invalid without either."""
    return UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)[0]


class Materials:
    """glTF materials by what binds them; `uv_set` tells which TEXCOORD a primvar name became."""

    def __init__(self, document: Document, textures: Textures, lost: Lost, time: Usd.TimeCode) -> None:
        self.document, self.textures, self.lost, self.time = document, textures, lost, time
        self._known: dict[tuple, int] = {}
        self._sets: dict[int, tuple[list[str], bool]] = {}

    def of(self, prim: Usd.Prim, double_sided: bool, names: list[str], plain: tuple[float, ...]) -> tuple[int, list[str], bool]:
        """Material of a prim or subset, the primvars its textures read, and whether display colours multiply it.

        `plain` is the colour of a prim without a material.
        """
        material = bound_material(prim)
        path = str(material.GetPath()) if material else ""
        key = (path, double_sided, () if path else plain, tuple(names) if path else ())
        if key not in self._known:
            self._sets_of: list[str] = []
            self._display = not path
            data = self._material(material) if path else _plain(plain)
            if double_sided:
                data["doubleSided"] = True
            self._known[key] = self.document.append("materials", data)
            self._sets[self._known[key]] = (self._sets_of, self._display)
        return self._known[key], *self._sets[self._known[key]]

    def _material(self, material: UsdShade.Material) -> dict[str, Any]:
        path = str(material.GetPath())
        self._read = Readers(path, self.time, self.lost)
        shader = material.ComputeSurfaceSource()[0]
        shader_id = shader.GetIdAttr().Get() if shader else None
        if shader_id not in _PREVIEWS:
            for context in ("mtlx", "ri", "mdl"):
                other = material.ComputeSurfaceSource(context)[0]
                if not shader and other:
                    shader, shader_id = other, other.GetIdAttr().Get()
        if not shader:
            self.lost.add(path, "material without a surface", "it is drawn grey; give it a UsdPreviewSurface")
            return {"name": material.GetPrim().GetName(), "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}
        displaced = material.ComputeDisplacementSource()[0]
        if displaced and (_linked(displaced, "displacement") or self._read.constant(displaced, "displacement")):
            self.lost.add(path, "displacement", "bake it into the mesh or a normal map")
        if shader_id in _MATERIALX:
            return self._materialx(material, shader, _MATERIALX[shader_id])
        if shader_id not in _PREVIEWS:
            self.lost.add(path, f"{shader_id} shader", "it is drawn grey; give the material a UsdPreviewSurface too")
            return {"name": material.GetPrim().GetName(), "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0}}
        return self._preview(material, shader)

    def _preview(self, material: UsdShade.Material, shader: UsdShade.Shader) -> dict[str, Any]:
        path = str(material.GetPath())
        pbr: dict[str, Any] = {}
        out: dict[str, Any] = {"name": material.GetPrim().GetName(), "pbrMetallicRoughness": pbr}
        self._base(shader, path, out, pbr)
        workflow = self._read.value(shader, "useSpecularWorkflow", 0)
        if workflow:
            colour = self._read.value(shader, "specularColor", Gf.Vec3f(0))
            self._extension(out, "KHR_materials_specular", {"specularColorFactor": [tidy(max(c, 0)) for c in colour]})
            self.lost.add(path, "specular workflow", "its specular colour tints the highlights of a dielectric; metals need metallic instead")
            pbr["metallicFactor"] = 0
            rough = self._input(shader, "roughness", 0.5, path)
            pbr["roughnessFactor"] = tidy(rough) if not isinstance(rough, Reader) else 1
        else:
            self._metal_rough(shader, path, pbr)
        self._normal(shader, path, out)
        self._emission(shader, path, out)
        occlusion = self._input(shader, "occlusion", 1.0, path)
        if isinstance(occlusion, Reader):
            texture = self._single(occlusion, 0, path, "occlusion")
            if texture is not None:
                out["occlusionTexture"] = self._info(texture, occlusion)
        ior = float(self._read.value(shader, "ior", 1.5))
        if abs(ior - 1.5) > 1e-6 and (ior >= 1 or ior == 0):
            self._extension(out, "KHR_materials_ior", {"ior": tidy(ior)})
        coat = self._input(shader, "clearcoat", 0.0, path)
        coat_rough = self._input(shader, "clearcoatRoughness", 0.01, path)
        if isinstance(coat, Reader) or coat > 0:
            data: dict[str, Any] = {"clearcoatFactor": 1.0 if isinstance(coat, Reader) else tidy(coat)}
            data["clearcoatRoughnessFactor"] = 1.0 if isinstance(coat_rough, Reader) else tidy(coat_rough)
            for reader, channel, name in ((coat, 0, "clearcoatTexture"), (coat_rough, 1, "clearcoatRoughnessTexture")):
                texture = self._single(reader, channel, path, name) if isinstance(reader, Reader) else None
                if texture is not None:
                    data[name] = self._info(texture, reader)
            self._extension(out, "KHR_materials_clearcoat", data)
        if _linked(shader, "displacement"):
            self.lost.add(path, "displacement", "bake it into the mesh or a normal map")
        return out

    def _base(self, shader: UsdShade.Shader, path: str, out: dict, pbr: dict) -> None:
        colour = self._input(shader, "diffuseColor", Gf.Vec3f(0.18), path)
        opacity = self._input(shader, "opacity", 1.0, path)
        threshold = float(self._read.value(shader, "opacityThreshold", 0.0))
        factor = [1.0, 1.0, 1.0, 1.0]
        alpha = isinstance(opacity, Reader) or opacity < 1
        if isinstance(colour, Reader):
            factor[:3], channel = _factored(colour.channel, highest=1)
        else:
            factor[:3] = [tidy(min(max(c, 0), 1)) for c in colour]
            if max(colour) > 1:
                self.lost.add(path, "diffuseColor over 1", "it is cut off at 1; give it a colour that reflects no more than it gets")
        if not isinstance(opacity, Reader):
            factor[3] = tidy(min(max(opacity, 0), 1))
        texture, reader = None, colour
        if isinstance(colour, Reader) and isinstance(opacity, Reader):
            self._one_place(path, {"diffuseColor": colour, "opacity": opacity})
            same = (opacity.channel.asset, opacity.channel.output, channel.output) == (channel.asset, "a", "rgb")
            if same and _plain_channel(opacity.channel) and _plain_channel(channel):
                texture = self.textures.copied(channel, path, colour.wrap, colour=True)
            else:
                texture = self.textures.packed(_rgb(channel) | {3: opacity.channel}, path, colour.wrap, "base", colour=True)
        elif isinstance(colour, Reader):
            if channel.output == "rgb" and not alpha and _plain_channel(channel):
                # An alpha channel that nothing reads does no harm: alphaMode stays OPAQUE.
                texture = self.textures.copied(channel, path, colour.wrap, colour=True)
            else:
                texture = self.textures.packed(_rgb(channel), path, colour.wrap, "base", colour=True)
        elif isinstance(opacity, Reader):
            reader = opacity
            texture = self.textures.packed({0: 1.0, 1: 1.0, 2: 1.0, 3: opacity.channel}, path, opacity.wrap, "opacity")
        if texture is not None:
            pbr["baseColorTexture"] = self._info(texture, reader)
        elif isinstance(colour, Reader):
            factor[:3] = [tidy(min(max(c, 0), 1)) for c in colour.fallback[:3]]
        if factor != [1, 1, 1, 1]:
            pbr["baseColorFactor"] = factor
        if alpha and threshold > 0:
            out["alphaMode"], out["alphaCutoff"] = "MASK", tidy(threshold)
        elif alpha:
            out["alphaMode"] = "BLEND"

    def _metal_rough(self, shader: UsdShade.Shader, path: str, pbr: dict) -> None:
        metal = self._input(shader, "metallic", 0.0, path)
        rough = self._input(shader, "roughness", 0.5, path)
        readers = [r for r in (metal, rough) if isinstance(r, Reader)]
        pbr["metallicFactor"] = 1 if isinstance(metal, Reader) else tidy(min(max(metal, 0), 1))
        pbr["roughnessFactor"] = 1 if isinstance(rough, Reader) else tidy(min(max(rough, 0), 1))
        if not readers:
            return
        if len(readers) == 2:
            self._one_place(path, {"metallic": metal, "roughness": rough})
        ready = (
            all((r.channel.asset, r.channel.space) == (readers[0].channel.asset, readers[0].channel.space) and _plain_channel(r.channel) for r in readers)
            and (not isinstance(metal, Reader) or metal.channel.output == "b")
            and (not isinstance(rough, Reader) or rough.channel.output == "g")
        )
        if ready:
            texture = self.textures.copied(readers[0].channel, path, readers[0].wrap)
        else:
            parts: dict[int, Channel | float] = {0: 1.0}
            parts[1] = rough.channel if isinstance(rough, Reader) else 1.0
            parts[2] = metal.channel if isinstance(metal, Reader) else 1.0
            texture = self.textures.packed(parts, path, readers[0].wrap, "metallic-roughness")
        if texture is not None:
            pbr["metallicRoughnessTexture"] = self._info(texture, readers[0])
        else:
            pbr["metallicFactor"] = tidy(metal.fallback[0]) if isinstance(metal, Reader) else pbr["metallicFactor"]
            pbr["roughnessFactor"] = tidy(rough.fallback[0]) if isinstance(rough, Reader) else pbr["roughnessFactor"]

    def _normal(self, shader: UsdShade.Shader, path: str, out: dict) -> None:
        normal = self._input(shader, "normal", Gf.Vec3f(0, 0, 1), path)
        if not isinstance(normal, Reader):
            return
        standard = np.allclose(normal.channel.scale[:3], 2) and np.allclose(normal.channel.bias[:3], -1)
        if standard:
            texture = self.textures.copied(normal.channel, path, normal.wrap)
        else:
            texture = self.textures.normal(normal.channel, path, normal.wrap)
        if texture is not None:
            out["normalTexture"] = self._info(texture, normal)

    def _emission(self, shader: UsdShade.Shader, path: str, out: dict) -> None:
        emission = self._input(shader, "emissiveColor", Gf.Vec3f(0), path)
        if isinstance(emission, Reader):
            factor, channel = _factored(emission.channel, highest=np.inf)
            # An image holds 0 to 1: what is brighter goes into the factor.
            top = self.textures.top(channel, path)
            factor, channel = np.array(factor) * top, _scaled(channel, 1 / top)
            if channel.output == "rgb" and _plain_channel(channel):
                texture = self.textures.copied(channel, path, emission.wrap, colour=True)
            else:
                texture = self.textures.packed(_rgb(channel), path, emission.wrap, "emission", colour=True)
            if texture is None:
                factor = np.maximum(emission.fallback[:3], 0)
            else:
                out["emissiveTexture"] = self._info(texture, emission)
        else:
            factor = np.maximum(list(emission), 0)
        strength = max(float(np.max(factor)), 1.0)
        if np.max(factor) > 0:
            out["emissiveFactor"] = [tidy(f / strength) for f in factor]
        if strength > 1:
            self._extension(out, "KHR_materials_emissive_strength", {"emissiveStrength": tidy(strength)})

    def _materialx(self, material: UsdShade.Material, shader: UsdShade.Shader, inputs: tuple[str, ...]) -> dict[str, Any]:
        path = str(material.GetPath())
        self.lost.add(path, "MaterialX surface", "only its plain colour, metal, roughness, ior and transmission are used; give it a UsdPreviewSurface too")
        values = [self._read.constant(shader, name) if name else None for name in inputs]
        colour, metal, rough, ior, transmission, weight = (v if fits(v, (0, 0, 0) if i == 0 else 0) else None for i, v in enumerate(values))
        base = list(colour) if colour is not None else [0.8, 0.8, 0.8]
        scale = 1.0 if weight is None else float(weight)
        pbr = {"baseColorFactor": [*(tidy(min(max(c * scale, 0), 1)) for c in base), 1]}
        pbr["metallicFactor"] = tidy(min(max(metal, 0), 1)) if metal is not None else 0
        pbr["roughnessFactor"] = tidy(min(max(rough, 0), 1)) if rough is not None else 0.3
        out: dict[str, Any] = {"name": material.GetPrim().GetName(), "pbrMetallicRoughness": pbr}
        if ior is not None and ior >= 1:
            self._extension(out, "KHR_materials_ior", {"ior": tidy(ior)})
        if transmission:
            self._extension(out, "KHR_materials_transmission", {"transmissionFactor": tidy(min(max(transmission, 0), 1))})
        return out

    def _input(self, shader: UsdShade.Shader, name: str, default: Any, path: str) -> Any:
        """A number, a colour, or the Reader of a texture."""
        found = shader.GetInput(name)
        if not found:
            return default
        for attribute in UsdShade.Utils.GetValueProducingAttributes(found):
            if UsdShade.Utils.GetType(attribute.GetName()) != UsdShade.AttributeType.Output:
                return self._read.fitting(self._read.at_first_frame(attribute, name), name, default)
            node = UsdShade.Shader(attribute.GetPrim())
            kind = node.GetIdAttr().Get()
            if kind == "UsdUVTexture" and attribute.GetBaseName() in OUTPUTS:
                return self._read.texture(node, OUTPUTS[attribute.GetBaseName()])
            if kind and kind.startswith("UsdPrimvarReader"):
                variable = str(self._read.value(node, "varname", ""))
                if variable == _VERTEX_COLOURS.get(name):
                    # A factor of 1 gives them alone.
                    self._display = True
                    return Gf.Vec3f(1) if name == "diffuseColor" else 1.0
                self.lost.add(path, f"{name} from primvar {variable!r}", "only diffuseColor from displayColor, opacity from displayOpacity; use a texture")
                return self._read.value(node, "fallback", default)
            self.lost.add(path, f"{name} from a {kind} node", "only textures and constants are carried; bake it")
            return default
        return default

    def _one_place(self, path: str, readers: dict[str, Reader]) -> None:
        """Name two images that glTF keeps in one and that lie differently on the surface."""
        (first, one), (second, other) = readers.items()
        if not one.placed_as(other):
            self.lost.add(path, f"{first} and {second} placed differently", f"both are placed as {first} is; give both the same st, transform and wrap")

    def _single(self, reader: Reader, channel: int, path: str, name: str) -> int | None:
        """A texture with the reader's channel where glTF wants it."""
        if _plain_channel(reader.channel) and "rgba".index(reader.channel.output[0]) == channel:
            return self.textures.copied(reader.channel, path, reader.wrap)
        return self.textures.packed({0: reader.channel, 1: reader.channel, 2: reader.channel}, path, reader.wrap, name)

    def _info(self, texture: int, reader: Reader) -> dict[str, Any]:
        if reader.st not in self._sets_of:
            self._sets_of.append(reader.st)
        info: dict[str, Any] = {"index": texture}
        number = self._sets_of.index(reader.st)
        if number:
            info["texCoord"] = number
        if reader.transform is not None:
            self.document.use_extension("KHR_texture_transform")
            info["extensions"] = {"KHR_texture_transform": reader.transform}
        return info

    def _extension(self, material: dict, name: str, value: dict) -> None:
        self.document.use_extension(name)
        material.setdefault("extensions", {})[name] = value


def _plain(colour: tuple[float, ...]) -> dict[str, Any]:
    """What a mesh without a material looks like: its display colour, rough."""
    pbr = {"baseColorFactor": [tidy(min(max(c, 0), 1)) for c in colour], "metallicFactor": 0, "roughnessFactor": 1}
    return {"name": "displayColor", "pbrMetallicRoughness": pbr} | ({"alphaMode": "BLEND"} if colour[3] < 1 else {})


def _rgb(channel: Channel) -> dict[int, Channel | float]:
    """Red, green and blue from the same image, as the output says."""
    return {i: replace(channel, output=c) for i, c in enumerate(_letters(channel))}


def _letters(channel: Channel) -> str:
    """The image's channels that red, green and blue come from."""
    return "rgb" if channel.output == "rgb" else channel.output * 3


def _factored(channel: Channel, highest: float) -> tuple[list[float], Channel]:
    """The scale as glTF's colour factor, which may be up to `highest`, and what is then left to do to the image."""
    used = ["rgba".index(c) for c in _letters(channel)]
    if any(channel.bias[i] for i in used) or not all(0 <= channel.scale[i] <= highest for i in used):
        return [1.0, 1.0, 1.0], channel
    return [tidy(channel.scale[i]) for i in used], Channel(channel.asset, channel.output, space=channel.space)


def _scaled(channel: Channel, factor: float) -> Channel:
    return replace(channel, scale=tuple(x * factor for x in channel.scale), bias=tuple(x * factor for x in channel.bias))


def _plain_channel(channel: Channel) -> bool:
    """Whether nothing is done to the values of the file."""
    return all(abs(channel.scale[c] - 1) < 1e-6 and abs(channel.bias[c]) < 1e-6 for c in map("rgba".index, channel.output))


def _linked(shader: UsdShade.Shader, name: str) -> bool:
    found = shader.GetInput(name)
    return bool(found and found.HasConnectedSource())
