"""Lights: all four kinds of Blender as KHR_lights_punctual with extras, sampled.

Units: Blender's watts and watts per square metre times 683 lm/W, as its own exporter writes them (docs/extras.md, Units).
That exporter is not used for lights: it stops on colour temperature and on lights that are not normalised, and loses
radius, angle, area lights and all animation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..common.document import Document
from ..common.extras import LUMENS_PER_WATT, tidy
from ..common.motion import Animation, is_sheared
from ..common.report import Lost
from .cameras import view_matrix
from .constants import constant
from .nodes import source

_HALF_PI = math.pi / 2


@dataclass
class LightTrack:
    """One light as one instance shows it; every list has one entry a sample."""

    name: str
    data: bpy.types.Light
    poses: list[np.ndarray] = field(default_factory=list)
    values: list[dict[str, float]] = field(default_factory=list)
    visible: list[bool] = field(default_factory=list)
    stretched: bool = False
    sheared: bool = False

    def sample(self, data: bpy.types.Light, world: np.ndarray, visible: bool) -> None:
        """Record a light's evaluated data and world matrix."""
        scale = np.linalg.norm(np.array(world)[:3, :3], axis=0)
        self.stretched = self.stretched or bool(scale.max() > scale.min() * (1 + 1e-3))
        self.sheared = self.sheared or is_sheared(np.array(world)[None])
        self.poses.append(view_matrix(world))
        self.values.append(_values(data, scale))
        self.visible.append(visible)

    def hold(self) -> None:
        """The light is not there at this sample: keep its last values, unseen."""
        self.poses.append(self.poses[-1])
        self.values.append(self.values[-1])
        self.visible.append(False)

    def write(self, document: Document, animation: Animation, engine: str, lost: Lost) -> None:
        """Add light, node and channels as an engine renders them; a light that is never on is left out."""
        if not any(self.visible):
            return
        _warn(self.name, self.data, engine, lost)
        if self.data.type == "SPOT" and self.stretched:
            lost.add(self.name, "spot with different scales", "its cone is round; apply the scale, or use an area light")
        if self.data.type == "AREA" and self.sheared:
            lost.add(self.name, "sheared area light", "it keeps its right angles and what it faces; apply the scale of its parents")
        values = {key: np.array([sample[key] for sample in self.values]) for key in self.values[0]}
        document.use_extension("KHR_lights_punctual")
        lights = document.root.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {}).setdefault("lights", [])
        index = len(lights)
        lights.append(self._light(engine))
        node: dict = {"name": self.name, "extensions": {"KHR_lights_punctual": {"light": index}}}
        number = document.append("nodes", node)
        animation.node(node, number, np.array(self.poses))
        animation.visibility(node, number, np.array(self.visible))
        pointer = f"/extensions/KHR_lights_punctual/lights/{index}"
        colour = np.stack([values["r"], values["g"], values["b"]], axis=1)
        animation.pointer(f"{pointer}/color", colour)
        animation.pointer(f"{pointer}/intensity", values["intensity"])
        if self.data.type == "SPOT":
            animation.pointer(f"{pointer}/spot/innerConeAngle", values["inner"])
            animation.pointer(f"{pointer}/spot/outerConeAngle", values["outer"])
        if self.data.type in ("POINT", "SPOT"):
            animation.pointer(f"{pointer}/extras/radius", values["radius"])
        elif self.data.type == "SUN":
            animation.pointer(f"{pointer}/extras/angle", values["angle"])
        else:
            animation.pointer(f"{pointer}/extras/area/size", np.stack([values["width"], values["height"]], axis=1))

    def _light(self, engine: str) -> dict:
        first, kind = self.values[0], self.data.type
        light: dict = {
            "name": self.data.name,
            "type": {"POINT": "point", "SPOT": "spot", "SUN": "directional", "AREA": "spot"}[kind],
            "color": [float(first[c]) for c in "rgb"],
            "intensity": float(first["intensity"]),
            "extras": {},
        }
        if kind == "SPOT":
            light["spot"] = {"innerConeAngle": float(first["inner"]), "outerConeAngle": float(first["outer"])}
        if kind in ("POINT", "SPOT"):
            light["extras"]["radius"] = tidy(first["radius"])
        elif kind == "SUN":
            light["extras"]["angle"] = tidy(first["angle"])
        else:
            shape = "ellipse" if self.data.shape in ("DISK", "ELLIPSE") else "rectangle"
            light["extras"]["area"] = {"shape": shape, "size": [tidy(first["width"]), tidy(first["height"])]}
            light["spot"] = {"innerConeAngle": 0, "outerConeAngle": _HALF_PI}
        if _has_factors(engine) and self.data.specular_factor != 1:
            light["extras"]["specular"] = tidy(self.data.specular_factor)
        return light


def _values(data: bpy.types.Light, scale: np.ndarray) -> dict[str, float]:
    """Colour, intensity and shape in glTF's terms."""
    colour = np.array(data.color)
    if getattr(data, "use_temperature", False):
        colour = colour * np.array(data.temperature_color)
    node_colour, node_strength = _emission(data)
    colour = np.maximum(colour * node_colour, 0)
    power = data.energy * 2 ** getattr(data, "exposure", 0.0) * node_strength
    # glTF colours end at 1: what is above goes into the intensity.
    peak = max(float(colour.max()), 1.0)
    colour, power = colour / peak, power * peak
    out = dict(zip("rgb", map(float, colour), strict=True))
    if data.type == "SUN":
        if not getattr(data, "normalize", True):
            power *= math.pi * math.sin(data.angle / 2) ** 2
        return out | {"intensity": max(LUMENS_PER_WATT * power, 0), "angle": min(data.angle, math.pi)}
    if data.type == "AREA":
        width = data.size * scale[0]
        height = (data.size_y if data.shape in ("RECTANGLE", "ELLIPSE") else data.size) * scale[1]
        width, height = max(float(width), 1e-6), max(float(height), 1e-6)
        if not getattr(data, "normalize", True):
            surface = width * height * (math.pi / 4 if data.shape in ("DISK", "ELLIPSE") else 1)
            power *= surface
        return out | {"intensity": max(LUMENS_PER_WATT * power / math.pi, 0), "width": width, "height": height}
    if not getattr(data, "normalize", True):
        # Cycles then takes the power as radiance times pi, so it grows with the surface of the sphere.
        power *= 4 * math.pi * max(data.shadow_soft_size, 1e-6) ** 2
    out |= {"intensity": max(LUMENS_PER_WATT * power / (4 * math.pi), 0), "radius": data.shadow_soft_size}
    if data.type == "SPOT":
        half = min(data.spot_size / 2, _HALF_PI)
        # Cycles goes smoothly from 0 at cos(half) to 1 over a share `blend` of the cone, glTF by a square from the outer to the
        # inner cone. Both let the same light through where glTF takes three quarters of that way.
        inner = math.acos(min(math.cos(half) + (1 - math.cos(half)) * 0.75 * data.spot_blend, 1.0))
        out |= {"inner": min(inner, half - 1e-4) if half > 2e-4 else 0.0, "outer": half}
    return out


def _emission(data: bpy.types.Light) -> tuple[np.ndarray, float]:
    """Colour and strength of a light's Emission node, if they are constants; none where its nodes shine not."""
    tree = data.node_tree if data.use_nodes else None
    if tree is None:
        return np.ones(3), 1.0
    shown = _shown(tree)
    if shown is None:
        return np.ones(3), 0.0
    node = shown if shown.type == "EMISSION" else next((n for n in tree.nodes if n.type == "EMISSION"), None)
    if node is None:
        return np.ones(3), 1.0
    colour, strength = constant(node.inputs["Color"]), constant(node.inputs["Strength"])
    return np.ones(3) if colour is None else colour, 1.0 if strength is None else strength


def _shown(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """The node that a light shines by."""
    output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
    out = source(output.inputs["Surface"]) if output is not None else None
    return out.node if out is not None else None


def _is_plain(data: bpy.types.Light) -> bool:
    """Whether nothing is lost of a light's nodes."""
    shown = _shown(data.node_tree) if data.use_nodes and data.node_tree else None
    return shown is None or (shown.type == "EMISSION" and all(constant(shown.inputs[key]) is not None for key in ("Color", "Strength")))


def _has_factors(engine: str) -> bool:
    """Whether an engine scales a light's shares of diffuse and specular light: Cycles does not."""
    return engine != "CYCLES"


def _warn(name: str, data: bpy.types.Light, engine: str, lost: Lost) -> None:
    """Name what a light has that is not carried."""
    if not _is_plain(data):
        lost.add(name, "light nodes (texture, IES or falloff)", "only plain colour and strength are carried; use the light's own settings")
    if _has_factors(engine) and data.diffuse_factor != 1:
        lost.add(
            name,
            f"diffuse factor {data.diffuse_factor:g}",
            "it is 1 here; scale its layer, which is its part of the diffuse light, in compositing (--aov lights)",
        )
    if data.type == "AREA" and data.spread < math.pi - 1e-3:
        lost.add(name, "area light spread", "it shines over the whole half space; use a spot light for a beam")
    if data.type == "SPOT" and data.spot_size > math.pi + 1e-3:
        lost.add(name, "spot wider than 180 degrees", "glTF ends at 180 degrees; use a point light")
    if data.energy < 0:
        lost.add(name, "negative light", "it does not shine; darken the material or the picture instead")
    if getattr(data, "use_square", False):
        lost.add(name, "square spot", "its cone is round; use an area light with a smaller surface")
    if not getattr(data, "use_shadow", True):
        lost.add(name, "light without shadows", "it casts shadows here")
