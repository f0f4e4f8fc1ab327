"""UsdLux lights to KHR_lights_punctual with extras, and the dome to the world.

L = intensity * 2^exposure * colour * blackbody is a luminance (nits); what a light's shape makes of it is in
docs/extras.md, Units, after the quantities of UsdLuxLightAPI's documentation ("Quantities and units").
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from pxr import Usd, UsdGeom, UsdLux

from ..common.document import Document
from ..common.extras import LUMENS_PER_WATT, tidy
from ..common.motion import Animation, is_sheared, unscaled
from ..common.report import Lost
from . import exr
from .output import Output
from .readers import fits
from .textures import open_asset, resolved_path

_PUNCTUAL = ("SphereLight", "RectLight", "DiskLight", "CylinderLight", "DistantLight")
# The axes across which a light has one radius.
_ROUND = {"SphereLight": slice(0, 3), "CylinderLight": slice(1, 3)}
_HALF_PI = math.pi / 2
# A sun all over the sky; seven digits, as it is written, that are not above pi.
_WIDEST = 3.141592
# A cone of half the sky, likewise.
_WIDEST_CONE = 1.570796
# Beyond it single precision, which glTF has, soon ends.
_BRIGHTEST = 1e30


def is_light(prim: Usd.Prim) -> bool:
    """Whether a prim is a light of any kind (MeshLightAPI and plug-in lights too)."""
    return bool(prim.HasAPI(UsdLux.LightAPI)) or prim.IsA(UsdLux.BoundableLightBase) or prim.IsA(UsdLux.NonboundableLightBase)


def is_dome(prim: Usd.Prim) -> bool:
    """Whether a prim is a dome light."""
    return prim.GetTypeName() in ("DomeLight", "DomeLight_1")


@dataclass
class LightTrack:
    """One light, sampled."""

    prim: Usd.Prim
    poses: list[np.ndarray] = field(default_factory=list)
    values: list[dict[str, float]] = field(default_factory=list)
    visible: list[bool] = field(default_factory=list)
    # Whether a round light is ever scaled to what is not round.
    uneven: bool = False
    sheared: bool = False

    def sample(self, time: Usd.TimeCode, world: np.ndarray, visible: bool, units: float) -> None:
        """Record the light; `world` is its matrix in glTF's space, `units` metres per stage unit."""
        scale = np.linalg.norm(world[:3, :3], axis=0)
        self.values.append(_values(self.prim, time, scale, units))
        across = scale[_ROUND[self.prim.GetTypeName()]] if self.prim.GetTypeName() in _ROUND else scale[:1]
        self.uneven |= bool(np.ptp(across) > 1e-3 * across.max())
        self.sheared |= self.prim.GetTypeName() in ("RectLight", "DiskLight") and is_sheared(world[None])
        self.poses.append(unscaled(world))
        self.visible.append(visible)

    def write(self, document: Document, animation: Animation, lost: Lost) -> None:
        """Add light, node, channels."""
        kind = self.prim.GetTypeName()
        path = str(self.prim.GetPath())
        if kind not in _PUNCTUAL:
            lost.add(path, f"{kind or 'mesh'} light", "it does not shine; replace it by a UsdLux light with a shape, or give the mesh an emissive material")
            return
        if not any(self.visible):
            return
        if not (np.abs([list(v.values()) for v in self.values]) < _BRIGHTEST).all():
            lost.add(path, "light whose brightness or size is no usable number", "it does not shine; check its intensity, exposure and size")
            return
        _warn(self.prim, lost)
        if self.uneven:
            lost.add(path, "round light that is scaled unevenly", "it stays round; scale it evenly, or use a disk light")
        if self.sheared:
            lost.add(path, "sheared area light", "it keeps its right angles and what it faces; scale it without its parents")
        values = {k: np.array([v[k] for v in self.values]) for k in self.values[0]}
        first = self.values[0]
        wide = values.get("outer", np.full(1, _HALF_PI)) > _WIDEST_CONE
        spot = not wide.all()
        if spot and wide.any():
            lost.add(path, "cone that opens to 90 degrees and more", "it shines over half of the sky while it does; use a light without a cone for that time")
            values["outer"] = np.minimum(values["outer"], _WIDEST_CONE)
        light: dict[str, Any] = {
            "name": self.prim.GetName(),
            "type": "directional" if kind == "DistantLight" else "spot" if spot or "width" in first else "point",
            "color": [float(first[c]) for c in "rgb"],
            "intensity": float(first["intensity"]),
            "extras": {},
        }
        if "width" in first:
            light["extras"]["area"] = {
                "shape": "ellipse" if kind == "DiskLight" else "rectangle",
                "size": [tidy(first["width"]), tidy(first["height"])],
            }
            light["spot"] = {"innerConeAngle": 0, "outerConeAngle": _HALF_PI}
        elif spot:
            light["spot"] = {"innerConeAngle": float(first["inner"]), "outerConeAngle": float(values["outer"][0])}
        for key in ("radius", "angle"):
            if key in first:
                light["extras"][key] = tidy(first[key])
        specular = _get(self.prim, "inputs:specular", Usd.TimeCode.Default(), 1.0)
        if specular != 1:
            light["extras"]["specular"] = tidy(max(specular, 0))
        document.use_extension("KHR_lights_punctual")
        lights = document.root.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {}).setdefault("lights", [])
        lights.append(light)
        index = len(lights) - 1
        node: dict[str, Any] = {"name": self.prim.GetName(), "extensions": {"KHR_lights_punctual": {"light": index}}}
        number = document.append("nodes", node)
        animation.node(node, number, np.array(self.poses))
        animation.visibility(node, number, np.array(self.visible))
        pointer = f"/extensions/KHR_lights_punctual/lights/{index}"
        animation.pointer(f"{pointer}/color", np.stack([values["r"], values["g"], values["b"]], axis=1))
        animation.pointer(f"{pointer}/intensity", values["intensity"])
        if spot and "width" not in first:
            animation.pointer(f"{pointer}/spot/innerConeAngle", values["inner"])
            animation.pointer(f"{pointer}/spot/outerConeAngle", values["outer"])
        for key in ("radius", "angle"):
            if key in first:
                animation.pointer(f"{pointer}/extras/{key}", values[key])
        if "width" in first:
            animation.pointer(f"{pointer}/extras/area/size", np.stack([values["width"], values["height"]], axis=1))


def _get(prim: Usd.Prim, name: str, time: Usd.TimeCode, default: Any) -> Any:
    """An attribute's value; where it has none, or one of a wrong type, what it is without."""
    attribute = prim.GetAttribute(name)
    value = attribute.Get(time) if attribute else None
    numbers = not isinstance(default, str) and default is not None
    return default if value is None or (numbers and not fits(value, default)) else value


def radiance(prim: Usd.Prim, time: Usd.TimeCode) -> np.ndarray:
    """L of a light as linear RGB, before `normalize`."""
    colour = np.array(_get(prim, "inputs:color", time, (1, 1, 1)), dtype=float)
    if _get(prim, "inputs:enableColorTemperature", time, False):
        colour = colour * np.array(UsdLux.BlackbodyTemperatureAsRgb(_get(prim, "inputs:colorTemperature", time, 6500.0)))
    fallback = 50000.0 if prim.GetTypeName() == "DistantLight" else 1.0
    strength = float(_get(prim, "inputs:intensity", time, fallback)) * 2 ** min(float(_get(prim, "inputs:exposure", time, 0.0)), 1000.0)
    return np.maximum(colour * strength, 0)


def _values(prim: Usd.Prim, time: Usd.TimeCode, scale: np.ndarray, units: float) -> dict[str, float]:
    """Colour, intensity and shape; `scale` is metres per local unit along the light's axes."""
    kind = prim.GetTypeName()
    light = radiance(prim, time)
    normalize = bool(_get(prim, "inputs:normalize", time, False))
    out: dict[str, float] = {}
    if kind == "DistantLight":
        angle = math.radians(max(float(_get(prim, "inputs:angle", time, 0.53)), 0.0))
        spread = math.pi * math.sin(min(angle / 2, _HALF_PI)) ** 2
        factor = 1.0 if normalize or spread == 0 else spread
        out["angle"] = min(angle, _WIDEST)
    elif kind in ("RectLight", "DiskLight"):
        if kind == "RectLight":
            width, height = (float(_get(prim, f"inputs:{k}", time, 1.0)) for k in ("width", "height"))
        else:
            width = height = 2 * float(_get(prim, "inputs:radius", time, 0.5))
        width, height = max(width * scale[0], 1e-9), max(height * scale[1], 1e-9)
        surface = width * height * (math.pi / 4 if kind == "DiskLight" else 1)
        # The surface that `normalize` divides by is in the stage's own units.
        factor = surface / (surface / units**2) if normalize else surface
        out |= {"width": width, "height": height}
    elif kind == "CylinderLight":
        length = float(_get(prim, "inputs:length", time, 1.0)) * scale[0]
        radius = float(_get(prim, "inputs:radius", time, 0.5)) * scale[1]
        side = 2 * math.pi * max(radius, 1e-9) * max(length, 1e-9)
        # The mean over all directions: power = pi L side, spread over 4 pi.
        factor = side / 4 / (side / units**2 if normalize else 1)
        out["radius"] = radius
    else:
        radius = float(_get(prim, "inputs:radius", time, 0.5)) * scale[0]
        disc = math.pi * max(radius, 1e-9) ** 2
        factor = disc / (4 * disc / units**2 if normalize else 1)
        out["radius"] = 0.0 if _get(prim, "treatAsPoint", time, False) else radius
    cone = float(_get(prim, "inputs:shaping:cone:angle", time, 90.0))
    if prim.HasAPI(UsdLux.ShapingAPI) and kind == "SphereLight":
        outer = math.radians(min(90.0, max(cone, 0.1)))
        soft = min(max(float(_get(prim, "inputs:shaping:cone:softness", time, 0.0)), 0.0), 1.0)
        out |= {"outer": outer, "inner": max(min(outer * (1 - soft), outer - 1e-4), 0.0)}
    total = light * factor * LUMENS_PER_WATT
    peak = float(total.max())
    colour = total / peak if 0 < peak < math.inf else np.ones(3)
    return out | dict(zip("rgb", map(float, colour), strict=True)) | {"intensity": peak}


def _warn(prim: Usd.Prim, lost: Lost) -> None:
    """Name what the light has that is not carried."""
    path, kind, now = str(prim.GetPath()), prim.GetTypeName(), Usd.TimeCode.EarliestTime()
    if kind == "CylinderLight":
        lost.add(path, "cylinder light", "it shines as a sphere of the same power; use rect lights for tubes")
    if _get(prim, "inputs:diffuse", now, 1.0) != 1:
        lost.add(path, "diffuse multiplier", "it counts as 1; change the intensity instead")
    asset = _get(prim, "inputs:texture:file", now, None)
    if asset is not None and asset.path:
        lost.add(path, "light texture", "its mean is not taken either; put the mean colour into the light's colour")
    if prim.HasAPI(UsdLux.ShapingAPI):
        if _get(prim, "inputs:shaping:focus", now, 0.0):
            lost.add(path, "shaping:focus", "use shaping:cone instead")
        ies = _get(prim, "inputs:shaping:ies:file", now, None)
        if ies is not None and ies.path:
            lost.add(path, "IES profile", "use shaping:cone instead")
        if kind != "SphereLight" and _get(prim, "inputs:shaping:cone:angle", now, 90.0) < 90:
            lost.add(path, "shaping of an area light", "it shines over the whole half space; use a sphere light for a beam")
    if prim.HasAPI(UsdLux.ShadowAPI):
        if not _get(prim, "inputs:shadow:enable", now, True):
            lost.add(path, "light without shadows", "it casts shadows here")
        elif any(_get(prim, "inputs:shadow:color", now, (0, 0, 0))) or _get(prim, "inputs:shadow:distance", now, -1.0) >= 0:
            lost.add(path, "shadow colour or distance", "its shadows are black and as long as they are")
    _warn_of_links(prim, lost)


def _warn_of_links(prim: Usd.Prim, lost: Lost) -> None:
    """Name what chooses the things that a light lights."""
    path, light = str(prim.GetPath()), UsdLux.LightAPI(prim)
    for links in (light.GetLightLinkCollectionAPI(), light.GetShadowLinkCollectionAPI()):
        # Without an opinion of the scene's the root is included: all things are.
        if links.GetExcludesRel().GetTargets() or links.GetIncludeRootAttr().Get() is False:
            lost.add(path, "light linking", "it lights everything here")
    if light.GetFiltersRel().GetTargets():
        lost.add(path, "light filters", "they are left out")


@dataclass
class DomeTrack:
    """A dome light over the shot: as it is where it is first seen, and whether it is ever otherwise."""

    prim: Usd.Prim
    seen: tuple[Usd.TimeCode, np.ndarray] | None = None
    states: set[bytes] = field(default_factory=set)

    def sample(self, time: Usd.TimeCode, world: np.ndarray, visible: bool) -> None:
        """Take it in at a time, with its matrix in glTF's space."""
        if visible and self.seen is None:
            self.seen = (time, world)
        state = np.concatenate([radiance(self.prim, time), np.round(unscaled(world), 6).ravel()]) * float(visible)
        self.states.add((state + 0.0).tobytes())


def write_dome(prim: Usd.Prim, time: Usd.TimeCode, world: np.ndarray, up: str, output: Output, lost: Lost) -> dict[str, Any]:
    """A dome light as `extras.buzz.world`. `world` is its matrix in glTF's space, scale aside."""
    path = str(prim.GetPath())
    _warn_of_links(prim, lost)
    light = radiance(prim, time)
    if not (light < _BRIGHTEST).all():
        lost.add(path, "light whose brightness is no usable number", "the sky is black; check its intensity and exposure")
        light = np.zeros(3)
    strength = float(light.max())
    out: dict[str, Any] = {"color": [tidy(c / strength) if strength else 0 for c in light], "strength": tidy(strength)}
    asset = _get(prim, "inputs:texture:file", time, None)
    if asset is None or not asset.path:
        return out
    name = resolved_path(asset)
    suffix = Path(name.rstrip("]").rsplit("[", 1)[-1]).suffix.lower()
    data = open_asset(name)
    if data is None:
        lost.add(path, f"texture {asset.path} is missing", "the dome is a plain colour; check the path")
        return out
    if suffix not in (".hdr", ".exr", ".png", ".jpg", ".jpeg"):
        lost.add(path, f"dome texture in {suffix or 'an unknown format'}", "save it as .hdr or .exr")
        return out
    layout = str(_get(prim, "inputs:texture:format", time, "automatic"))
    if layout not in ("automatic", "latlong"):
        lost.add(path, f"{layout} dome texture", "convert it to latlong; the dome is a plain colour")
        return out
    if data[:4] == exr.MAGIC:
        try:
            data = exr.coloured(data)
        except ImportError:
            # What it holds cannot be found out; nearly all have colours.
            pass
        except (KeyError, OSError, RuntimeError):
            lost.add(path, f"dome texture {asset.path} is in a format that cannot be read", "save it with channels R, G and B; the dome is a plain colour")
            return out
    file = output.add(f"{output.target.stem}_world", suffix, data)
    turn = unscaled(world)[:3, :3]
    if prim.GetTypeName() == "DomeLight_1":
        pole = str(_get(prim, "poleAxis", time, "scene"))
        if pole == "Z" or (pole == "scene" and up == UsdGeom.Tokens.z):
            # The dome itself is then set up along Z; the spec turns it by 90 degrees about X.
            turn = turn @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
    if turn[1, 1] < 0.9999:
        lost.add(path, "tilted dome", "only its turn about the vertical is carried; rotate the image instead")
    # USD's (OpenEXR's) centre looks along +Z of the dome, docs/extras.md's along +X: from +X to +Z is -90 degrees.
    forward = turn @ np.array([0.0, 0.0, 1.0])
    return out | {"image": quote(file), "rotation": tidy(math.atan2(-forward[2], forward[0]))}
