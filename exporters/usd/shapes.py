"""Geometry of one export: what each prim is drawn with, and the glTF meshes made of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from ..common.document import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, Document
from ..common.morph import choose_targets
from ..common.report import Lost
from .gprims import read_gprim
from .materials import Materials, bound_material
from .mesh import DISPLAY, Primitive, add_pose, faces_at, inherited, may_deform, pose_at, read_mesh

_DISPLAY = (0.5, 0.5, 0.5, 1.0)


@dataclass
class Geometry:
    """What a prim is drawn with."""

    prim: Usd.Prim
    primitives: list[Primitive]
    placed: np.ndarray = field(default_factory=lambda: np.eye(4))
    implicit: dict | None = None
    faces: tuple[bytes, ...] = ()
    # Numbers of its different poses (0 is the mesh itself), and which pose it has at which samples.
    poses: dict[tuple[bytes, ...], int] = field(default_factory=dict)
    samples: list[int] = field(default_factory=list)
    posed: list[int] = field(default_factory=list)
    mesh: int | None = None
    binding: dict | None = None
    weights: np.ndarray | None = None


class Geometries:
    """Hands out geometry numbers; instances of one prototype with the same materials share one."""

    def __init__(self, levels: int, lost: Lost) -> None:
        self.levels, self.lost = levels, lost
        self.items: list[Geometry] = []
        self._sources: dict[Usd.Prim, tuple] = {}
        self._deforms: dict[Usd.Prim, bool] = {}
        self._by_source: dict[tuple, list[int]] = {}
        self._current: dict[tuple, int] = {}
        self._sample = -1

    def of(self, prim: Usd.Prim, kind: str, time: Usd.TimeCode, sample: int) -> int | None:
        """The geometry of a prim at a sample; None if there is nothing to draw."""
        if sample != self._sample:
            self._sample, self._current = sample, {}
        if prim not in self._sources:
            self._sources[prim] = _source(prim, time)
            self._deforms[prim] = kind == "mesh" and may_deform(prim)
        source = self._sources[prim]
        if source in self._current:
            return self._current[source]
        known = self._by_source.setdefault(source, [])
        if known and not self._deforms[prim]:
            return known[0]
        number = self._next(prim, kind, time, sample, known)
        if number is not None:
            self._current[source] = number
        return number

    def _next(self, prim: Usd.Prim, kind: str, time: Usd.TimeCode, sample: int, known: list[int]) -> int | None:
        if kind == "mesh":
            faces, pose = faces_at(prim, time), pose_at(prim, time)
            for number in reversed(known):
                item = self.items[number]
                if item.faces == faces and (pose in item.poses or add_pose(item.primitives, prim, time, self.levels, self.lost)):
                    item.posed.append(item.poses.setdefault(pose, len(item.poses)))
                    item.samples.append(sample)
                    return number
            primitives = read_mesh(prim, time, self.levels, self.lost)
            if not primitives:
                return None
            item = Geometry(prim, primitives, faces=faces, poses={pose: 0}, samples=[sample], posed=[0])
        else:
            shape = read_gprim(prim, time)
            if shape is None:
                self.lost.add(str(prim.GetPath()), "size that is no number over 0", "it is left out; check its attributes")
                return None
            varying = [a.GetName() for a in prim.GetAttributes() if a.GetName() in _SIZES and a.ValueMightBeTimeVarying()]
            if varying:
                self.lost.add(str(prim.GetPath()), f"animated {', '.join(varying)}", "animate its scale instead; the first frame's is used")
            arrays = {"POSITION": shape.points.astype(np.float32), "NORMAL": shape.normals.astype(np.float32)}
            arrays |= self._constant_colour(prim, time, len(shape.points))
            primitive = Primitive(arrays, shape.indices.astype(np.uint32), prim, np.empty(0, int))
            item = Geometry(prim, [primitive], shape.placed, shape.implicit)
        self.items.append(item)
        known.append(len(self.items) - 1)
        return known[-1]

    def write(self, document: Document, materials: Materials, taken: np.ndarray) -> None:
        """Make the glTF meshes. `taken` holds the frame of each sample in the order in which they were taken."""
        for item in self.items:
            self._write(item, document, materials, taken)

    def _write(self, item: Geometry, document: Document, materials: Materials, taken: np.ndarray) -> None:
        chosen = None
        if len(item.poses) > 1:
            times = taken[item.samples]
            order = np.argsort(times)
            times, posed = times[order], np.array(item.posed)[order]
            # Of poses that stay the same for a while the first and the last say all.
            ends = np.diff(posed, prepend=-1, append=-1) != 0
            kept = np.flatnonzero(ends[:-1] | ends[1:])
            rows = [np.concatenate([_pose(p, k)["POSITION"].reshape(-1) for p in item.primitives]) for k in posed[kept]]
            chosen = choose_targets(np.stack(rows), times[kept], np.sort(taken))
            if chosen is not None:
                numbers, item.weights = chosen
                chosen = [int(posed[kept[n]]) for n in numbers]
        double = bool(UsdGeom.Gprim(item.prim).GetDoubleSidedAttr().Get())
        primitives = []
        for p in item.primitives:
            names = [k.removeprefix("st:") for k in p.attributes if k.startswith("st:")]
            plain, vertex_colours = _display(p)
            number, sets, display = materials.of(p.source, double, names, plain)
            if display and vertex_colours is None and bound_material(p.source):
                vertex_colours = np.tile(plain, (len(p.attributes["POSITION"]), 1))
            self._name_animated(item.prim, [*sets, *(("displayColor", "displayOpacity") if display else ())])
            data: dict[str, Any] = {
                "attributes": self._attributes(p, sets, vertex_colours if display else None, document),
                "indices": document.add_accessor(_small(p.indices), ELEMENT_ARRAY_BUFFER),
                "material": number,
            }
            if chosen:
                data["targets"] = [self._target(p, k, document) for k in chosen]
            primitives.append(data)
        mesh: dict[str, Any] = {"name": item.prim.GetName(), "primitives": primitives}
        if chosen:
            mesh["weights"] = [0.0] * len(chosen)
        item.mesh = document.append("meshes", mesh)
        # What only a vertex can say is lost on a shape.
        plain = not _textured(document.root["materials"][primitives[0]["material"]]) and "COLOR_0" not in primitives[0]["attributes"]
        if item.implicit is not None and plain:
            document.use_extension("KHR_implicit_shapes")
            document.use_extension("BUZZ_analytic_shape")
            shapes = document.root.setdefault("extensions", {}).setdefault("KHR_implicit_shapes", {}).setdefault("shapes", [])
            if item.implicit not in shapes:
                shapes.append(item.implicit)
            item.binding = {"shape": shapes.index(item.implicit), "material": primitives[0]["material"]}

    def _constant_colour(self, prim: Usd.Prim, time: Usd.TimeCode, n: int) -> dict[str, np.ndarray]:
        """Display colour and opacity of a gprim, its own or inherited: the first value for all of it."""
        out = {}
        for name, (key, width) in DISPLAY.items():
            primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
            values = np.array((primvar.ComputeFlattened(time) if primvar else None) or [], dtype=float).reshape(-1, width)
            if len(values):
                out[key] = np.tile(values[0], (n, 1))
            if len(np.unique(values, axis=0)) > 1:
                self.lost.add(str(prim.GetPath()), f"{name} that varies over a shape", "its first value is used; convert the shape to a mesh")
        return out

    def _name_animated(self, prim: Usd.Prim, names: list[str]) -> None:
        """Name primvars that a picture would show changing: glTF's vertex attributes stay."""
        for name in names:
            primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
            if primvar and _changes(primvar):
                self.lost.add(str(prim.GetPath()), f"animated primvar {name}", "the first frame's values are used; bake it into a texture or cut the mesh up")

    def _attributes(self, p: Primitive, sets: list[str], colours: np.ndarray | None, document: Document) -> dict[str, int]:
        out = {"POSITION": document.add_accessor(p.attributes["POSITION"], ARRAY_BUFFER, limits=True)}
        if "NORMAL" in p.attributes:
            out["NORMAL"] = document.add_accessor(_unit(p.attributes["NORMAL"]), ARRAY_BUFFER)
        for number, name in enumerate(sets):
            values = p.attributes.get(f"st:{name}")
            if values is None:
                path = str(p.source.GetPath())
                self.lost.add(path, f"primvar {name!r} that its material reads is missing", "its texture shows one colour; add the primvar")
                values = np.zeros((len(p.attributes["POSITION"]), 2), dtype=np.float32)
            out[f"TEXCOORD_{number}"] = document.add_accessor(values, ARRAY_BUFFER)
        if colours is not None:
            out["COLOR_0"] = document.add_accessor(np.clip(colours, 0, 1).astype(np.float32), ARRAY_BUFFER)
        return out

    @staticmethod
    def _target(p: Primitive, k: int, document: Document) -> dict[str, int]:
        pose = _pose(p, k)
        out = {"POSITION": document.add_accessor((pose["POSITION"] - p.attributes["POSITION"]).astype(np.float32), ARRAY_BUFFER, limits=True)}
        if "NORMAL" in pose and "NORMAL" in p.attributes:
            out["NORMAL"] = document.add_accessor((_unit(pose["NORMAL"]) - _unit(p.attributes["NORMAL"])).astype(np.float32), ARRAY_BUFFER)
        return out


_SIZES = ("radius", "size", "height", "radiusTop", "radiusBottom", "width", "length", "axis")


def _source(prim: Usd.Prim, time: Usd.TimeCode) -> tuple:
    """What makes two prims' geometry the same: the prim in the prototype, what is bound to it and what it inherits."""
    bound = [prim, *UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()]
    paths = [str(bound_material(getattr(b, "GetPrim", lambda b=b: b)()).GetPath()) for b in bound]
    if not prim.IsInstanceProxy():
        return (str(prim.GetPath()), *paths)
    return (str(prim.GetPrimInPrototype().GetPath()), *paths, *inherited(prim, time))


def _pose(p: Primitive, k: int) -> dict[str, np.ndarray]:
    """Pose 0 is the primitive itself, the others were added."""
    return p.attributes if k == 0 else p.poses[k - 1]


def _display(p: Primitive) -> tuple[tuple[float, ...], np.ndarray | None]:
    """Display colour and opacity as one material colour, or as vertex colours."""
    colour, opacity = p.attributes.get("colour"), p.attributes.get("opacity")
    if colour is None and opacity is None:
        return _DISPLAY, None
    n = len(p.attributes["POSITION"])
    whole = np.empty((n, 4))
    whole[:, :3] = colour if colour is not None else _DISPLAY[:3]
    whole[:, 3] = opacity[:, 0] if opacity is not None else 1
    if n and (whole == whole[0]).all():
        return tuple(float(x) for x in whole[0]), None
    transparent = (1.0, 1.0, 1.0, 0.999) if opacity is not None and opacity.min() < 1 else (1.0, 1.0, 1.0, 1.0)
    return transparent, whole


def _changes(primvar: UsdGeom.Primvar) -> bool:
    """Whether a primvar ever has other values; many exporters write the same ones at every frame."""
    times = primvar.GetTimeSamples() if primvar.ValueMightBeTimeVarying() else []
    return any(primvar.ComputeFlattened(t) != primvar.ComputeFlattened(times[0]) for t in times[1:])


def _small(indices: np.ndarray) -> np.ndarray:
    return indices.astype(np.uint16) if len(indices) and indices.max() < 65535 else indices.astype(np.uint32)


def _unit(normals: np.ndarray) -> np.ndarray:
    normals = normals.astype(np.float64)
    return (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)).astype(np.float32)


def _textured(material: dict) -> bool:
    return "Texture" in str([k for k in (*material, *material.get("pbrMetallicRoughness", {})) if k.endswith("Texture")])
