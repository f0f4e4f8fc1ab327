"""UsdGeomMesh to glTF primitives: primvars of every interpolation, GeomSubsets, subdivision, movement of points."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

import numpy as np
from pxr import Usd, UsdGeom, UsdShade

from ..common.report import Lost
from .subdivide import INFINITE, Polygons, catmull_clark, face_varying, smooth_normals
from .triangulate import triangulate

_MAX_FACES = 4_000_000
# Primvars that colour a mesh: what their values are called in here, and how many numbers each has.
DISPLAY = {"displayColor": ("colour", 3), "displayOpacity": ("opacity", 1)}
_PURPOSES = (UsdShade.Tokens.full, UsdShade.Tokens.allPurpose)


@dataclass
class Primitive:
    """Triangles of one material: arrays by glTF attribute name, and the morph poses as (POSITION, NORMAL) arrays."""

    attributes: dict[str, np.ndarray]
    indices: np.ndarray
    # What binds its material: the mesh or one of its GeomSubsets.
    source: Usd.Prim
    # For each vertex, its point; for normals of poses, its corner.
    corner_of: np.ndarray
    poses: list[dict[str, np.ndarray]] = field(default_factory=list)


def read_mesh(prim: Usd.Prim, time: Usd.TimeCode, levels: int, lost: Lost) -> list[Primitive]:
    """The primitives of a mesh at one time; none if it has no valid face."""
    mesh = UsdGeom.Mesh(prim)
    polygons, _ = _polygons(mesh, time, levels, lost)
    if polygons is None:
        return []
    return [_primitive(polygons, chosen, source) for source, chosen in _subsets(mesh, polygons, time, lost)]


def add_pose(primitives: list[Primitive], prim: Usd.Prim, time: Usd.TimeCode, levels: int, lost: Lost) -> bool:
    """Record the mesh's shape at another time; False if its topology is another."""
    polygons, has_normals = _polygons(UsdGeom.Mesh(prim), time, levels, lost, posed=True)
    if polygons is None or any(len(p.corner_of) and p.corner_of.max() >= len(polygons.corners) for p in primitives):
        return False
    for p in primitives:
        pose = {"POSITION": polygons.points[polygons.corners[p.corner_of]]}
        if has_normals:
            pose["NORMAL"] = polygons.corner["NORMAL"][p.corner_of]
        p.poses.append(pose)
    return True


def _array(attribute: Usd.Attribute, time: Usd.TimeCode, dtype: type, width: int = 0) -> np.ndarray:
    """An attribute's values, rows of `width` numbers if any; empty where it has none or values of a wrong type (a mistyped layer)."""
    shape = (-1, width) if width else -1
    try:
        return np.array(attribute.Get(time) or [], dtype=dtype).reshape(shape)
    except (TypeError, ValueError):
        return np.empty(0, dtype=dtype).reshape(shape)


def may_deform(prim: Usd.Prim) -> bool:
    """Whether the points or the faces of a mesh change."""
    mesh = UsdGeom.Mesh(prim)
    return any(a.ValueMightBeTimeVarying() for a in (*_moving(mesh), *_topology(mesh)))


def faces_at(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[bytes, ...]:
    """What two times have to agree in for one to be a pose of the other."""
    return tuple(_digest(_array(a, time, int)) for a in _topology(UsdGeom.Mesh(prim)))


def pose_at(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[bytes, ...]:
    """What two times agree in if they have the same pose."""
    return tuple(_digest(_array(a, time, float)) for a in _moving(UsdGeom.Mesh(prim)))


def _digest(values: np.ndarray | None) -> bytes:
    return hashlib.blake2b(values if values is not None else b"", digest_size=16).digest()


def _moving(mesh: UsdGeom.Mesh) -> tuple[Usd.Attribute, ...]:
    normals = UsdGeom.PrimvarsAPI(mesh.GetPrim()).GetPrimvar("normals")
    attributes = (mesh.GetPointsAttr(), mesh.GetNormalsAttr(), mesh.GetCreaseSharpnessesAttr(), mesh.GetCornerSharpnessesAttr())
    return (*attributes, normals.GetAttr()) if normals else attributes


def _topology(mesh: UsdGeom.Mesh) -> tuple[Usd.Attribute, ...]:
    return (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetHoleIndicesAttr())


def _polygons(mesh: UsdGeom.Mesh, time: Usd.TimeCode, levels: int, lost: Lost, posed: bool = False) -> tuple[Polygons | None, bool]:
    """The mesh with all primvars at corners, of a pose with its normals only, subdivided; and whether it has normals."""
    path = str(mesh.GetPath())
    points = _array(mesh.GetPointsAttr(), time, float, 3)
    counts = _array(mesh.GetFaceVertexCountsAttr(), time, int)
    corners = _array(mesh.GetFaceVertexIndicesAttr(), time, int)
    if not len(points) or counts.max(initial=0) < 3:
        lost.add(path, "mesh without faces", "it is left out")
        return None, False
    if counts.sum() != len(corners) or counts.min() < 0 or corners.min() < 0 or corners.max() >= len(points):
        lost.add(path, "damaged mesh (its indices do not fit its points)", "it is left out; check it with usdchecker")
        return None, False
    if not np.isfinite(points).all():
        lost.add(path, "points that are not numbers", "they are moved to the origin")
        points = np.nan_to_num(points, nan=0.0, posinf=0.0, neginf=0.0)
    scheme = mesh.GetSubdivisionSchemeAttr().Get(time)
    if scheme == UsdGeom.Tokens.loop:
        lost.add(path, "loop subdivision", "it is drawn as its cage; convert it to catmullClark")
    out = Polygons(points, counts, corners, np.arange(len(counts)))
    _creases(mesh, time, out)
    subdivide = levels if scheme == UsdGeom.Tokens.catmullClark else 0
    seamed = _primvars(mesh, time, out, subdivide > 0, lost)
    if subdivide:
        # Authored normals mean nothing on a subdivision surface (UsdGeomMesh: "normals are ignored").
        out.corner.pop("NORMAL", None)
    if posed:
        out.vertex, out.corner, seamed = {}, {k: v for k, v in out.corner.items() if k == "NORMAL"}, []
    if out.counts.min() < 3:
        # A face of two corners or none is nothing to see, and no rule of subdivision speaks of it.
        out = _keep(out, out.counts >= 3)
    linear = str(mesh.GetFaceVaryingLinearInterpolationAttr().Get(time))
    if subdivide and linear != UsdGeom.Tokens.all:
        out.seamed = {key: face_varying(out, out.corner.pop(key), linear) for key in seamed}
    rule = mesh.GetInterpolateBoundaryAttr().Get(time)
    for level in range(subdivide):
        if len(out.corners) * 4 > _MAX_FACES:
            lost.add(path, f"subdivision beyond level {level}", "it would make more than four million faces; simplify the cage")
            break
        out = catmull_clark(out, corners_sharp=rule != UsdGeom.Tokens.edgeOnly)
    out.corner |= {k: v[out.corners] for k, v in out.vertex.items()} | {k: v.points[v.corners] for k, v in out.seamed.items()}
    holes = _array(mesh.GetHoleIndicesAttr(), time, int)
    good = ~np.isin(out.parents, holes)
    if not good.all():
        out = _keep(out, good)
    if not len(out.counts):
        return None, False
    if scheme == UsdGeom.Tokens.catmullClark:
        out.corner["NORMAL"] = smooth_normals(out)
    if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        _flip(out)
        if scheme == UsdGeom.Tokens.catmullClark:
            out.corner["NORMAL"] *= -1
    return out, "NORMAL" in out.corner


def _creases(mesh: UsdGeom.Mesh, time: Usd.TimeCode, out: Polygons) -> None:
    lengths = np.maximum(_array(mesh.GetCreaseLengthsAttr(), time, int), 1)
    indices = _array(mesh.GetCreaseIndicesAttr(), time, int)
    sharp = _array(mesh.GetCreaseSharpnessesAttr(), time, float)
    edges, values, at, used = [], [], 0, 0
    for length in lengths:
        for k in range(length - 1):
            if at + k + 1 < len(indices):
                edges.append((indices[at + k], indices[at + k + 1]))
                # One value for each crease, or one for each of its edges.
                number = used + k if len(sharp) != len(lengths) else used
                values.append(sharp[number] if number < len(sharp) else 0.0)
        at += length
        used += 1 if len(sharp) == len(lengths) else length - 1
    if edges:
        out.edges, out.sharpness = np.array(edges), np.minimum(np.array(values), INFINITE)
    out.point_sharpness = np.zeros(len(out.points))
    corners = _array(mesh.GetCornerIndicesAttr(), time, int)
    weights = _array(mesh.GetCornerSharpnessesAttr(), time, float)
    n = min(len(corners), len(weights))
    valid = (corners[:n] >= 0) & (corners[:n] < len(out.points))
    out.point_sharpness[corners[:n][valid]] = np.minimum(weights[:n][valid], INFINITE)


def _primvars(mesh: UsdGeom.Mesh, time: Usd.TimeCode, out: Polygons, smooth: bool, lost: Lost) -> list[str]:
    """Texture coordinates, colour and normals as values at corners; those of points at points where they are to be smoothed.

    The result names those that are face-varying.
    """
    path, seamed = str(mesh.GetPath()), []
    api = UsdGeom.PrimvarsAPI(mesh.GetPrim())
    for primvar in api.FindPrimvarsWithInheritance():
        name, taken = primvar.GetPrimvarName(), _taken(primvar)
        if taken is None:
            continue
        key, width = taken
        values = _numbers(primvar, time, width)
        if values is None:
            continue
        if width == 2:
            # USD's v goes up, glTF's goes down.
            values = np.stack([values[:, 0], 1 - values[:, 1]], axis=1)
        if smooth and primvar.GetInterpolation() == UsdGeom.Tokens.vertex and len(values) >= len(out.points):
            out.vertex[key] = values[: len(out.points)]
            continue
        values = _spread(values, primvar.GetInterpolation(), out, path, f"primvar {name}", lost)
        if values is not None:
            out.corner[key] = values
            seamed += [key] if primvar.GetInterpolation() == UsdGeom.Tokens.faceVarying else []
    # `primvars:normals` wins over the attribute `normals` (UsdGeomPointBased).
    normals = api.GetPrimvar("normals")
    values = None
    if normals and normals.HasValue():
        values = _numbers(normals, time, 3)
        if values is not None:
            values = _spread(values, normals.GetInterpolation(), out, path, "primvar normals", lost)
    elif mesh.GetNormalsAttr().HasAuthoredValue():
        data = _array(mesh.GetNormalsAttr(), time, float, 3)
        values = _spread(data, mesh.GetNormalsInterpolation(), out, path, "normals", lost)
    if values is not None:
        length = np.linalg.norm(values, axis=1, keepdims=True)
        out.corner["NORMAL"] = np.where(length > 1e-12, values / np.maximum(length, 1e-30), (0, 1, 0))
    return seamed


def inherited(prim: Usd.Prim, time: Usd.TimeCode) -> tuple:
    """What a prim's geometry has from above it: names and values of primvars."""
    found = [p for p in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance() if _taken(p) and p.GetAttr().GetPrim() != prim]
    return tuple((p.GetPrimvarName(), p.GetInterpolation(), _digest(_numbers(p, time, _taken(p)[1]))) for p in found)


def _taken(primvar: UsdGeom.Primvar) -> tuple[str, int] | None:
    """What a primvar's values are called in here, and how many numbers each has; None for those that no picture shows."""
    name = primvar.GetPrimvarName()
    if str(primvar.GetTypeName().scalarType) in ("texCoord2f", "texCoord2d", "texCoord2h", "float2"):
        return f"st:{name}", 2
    return DISPLAY.get(name)


def _numbers(primvar: UsdGeom.Primvar, time: Usd.TimeCode, width: int) -> np.ndarray | None:
    """A primvar's values, indices resolved; None if it has none that are numbers."""
    data = primvar.ComputeFlattened(time) if primvar.IsIndexed() else primvar.Get(time)
    try:
        values = np.array(data, dtype=float).reshape(-1, width) if data is not None else None
    except (TypeError, ValueError):
        return None
    return values if values is not None and np.isfinite(values).all() else None


def _spread(values: np.ndarray, interpolation: str, out: Polygons, path: str, name: str, lost: Lost) -> np.ndarray | None:
    """Values of an interpolation at every corner."""
    face_of = np.repeat(np.arange(len(out.counts)), out.counts)
    index = {
        UsdGeom.Tokens.constant: np.zeros(len(out.corners), dtype=int),
        UsdGeom.Tokens.uniform: face_of,
        UsdGeom.Tokens.vertex: out.corners,
        UsdGeom.Tokens.varying: out.corners,
        UsdGeom.Tokens.faceVarying: np.arange(len(out.corners)),
    }.get(interpolation)
    if index is None or (len(index) and index.max() >= len(values)):
        lost.add(path, f"{name} (its size does not fit {interpolation})", "it is left out; check it with usdchecker")
        return None
    return values[index]


def _keep(mesh: Polygons, faces: np.ndarray) -> Polygons:
    mask = np.repeat(faces, mesh.counts)
    corner = {k: v[mask] for k, v in mesh.corner.items()}
    return Polygons(
        mesh.points, mesh.counts[faces], mesh.corners[mask], mesh.parents[faces], mesh.edges, mesh.sharpness, mesh.point_sharpness, mesh.vertex, corner
    )


def _flip(mesh: Polygons) -> None:
    """Turn every face round."""
    starts = np.concatenate([[0], np.cumsum(mesh.counts)[:-1]])
    index = np.repeat(starts + mesh.counts - 1, mesh.counts) - (np.arange(len(mesh.corners)) - np.repeat(starts, mesh.counts))
    mesh.corners = mesh.corners[index]
    mesh.corner = {k: v[index] for k, v in mesh.corner.items()}


def _subsets(mesh: UsdGeom.Mesh, polygons: Polygons, time: Usd.TimeCode, lost: Lost) -> list[tuple[Usd.Prim, np.ndarray]]:
    """Material subsets as (prim that binds, faces); faces in no subset go with the mesh itself."""
    rest = np.ones(len(polygons.counts), dtype=bool)
    found = []
    for subset in UsdShade.MaterialBindingAPI(mesh.GetPrim()).GetMaterialBindSubsets():
        kind = subset.GetElementTypeAttr().Get()
        if kind != UsdGeom.Tokens.face:
            lost.add(str(subset.GetPath()), f"GeomSubset of elementType {kind}", "its material is not seen; give it faces")
            continue
        if subset.GetIndicesAttr().ValueMightBeTimeVarying():
            lost.add(str(subset.GetPath()), "animated indices", "those of the first frame are used; cut the mesh up")
        chosen = np.isin(polygons.parents, _array(subset.GetIndicesAttr(), time, int)) & rest
        if chosen.any():
            found.append((subset.GetPrim(), chosen))
            rest &= ~chosen
    for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh):
        if subset.GetFamilyNameAttr().Get() not in (UsdShade.Tokens.materialBind, None, "") and any(
            UsdShade.MaterialBindingAPI(subset.GetPrim()).GetDirectBinding(p).GetMaterial() for p in _PURPOSES
        ):
            lost.add(str(subset.GetPath()), "GeomSubset outside the family materialBind", "set its familyName to materialBind")
    if rest.any():
        found.append((mesh.GetPrim(), rest))
    return found


def _primitive(mesh: Polygons, chosen: np.ndarray, source: Usd.Prim) -> Primitive:
    """Triangulate faces and join equal corners into vertices."""
    within = np.flatnonzero(np.repeat(chosen, mesh.counts))
    triangles = within[triangulate(mesh.points, mesh.corners[within], mesh.counts[chosen])].reshape(-1)
    columns = [mesh.corners[triangles, None].astype(float)]
    columns += [np.round(v[triangles], 7) for v in mesh.corner.values()]
    _, first, indices = np.unique(np.concatenate(columns, axis=1), axis=0, return_index=True, return_inverse=True)
    corner_of = triangles[first]
    attributes = {"POSITION": mesh.points[mesh.corners[corner_of]].astype(np.float32)}
    attributes |= {k: v[corner_of].astype(np.float32) for k, v in mesh.corner.items()}
    return Primitive(attributes, indices.reshape(-1).astype(np.uint32), source, corner_of)
