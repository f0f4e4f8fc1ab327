"""Sphere, Cube, Cylinder, Cone, Capsule and Plane: the analytic shape, and a mesh for readers without it.

Shapes are stored along Y (KHR_implicit_shapes); USD's `axis` becomes a rotation of the node.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

_SEGMENTS, _RINGS = 48, 24

# Y of the shape to USD's axis, both right-handed; the columns are where X, Y and Z go.
_AXES = {
    "X": np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float),
    "Y": np.eye(4),
    "Z": np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float),
}


@dataclass
class Shape:
    """A KHR_implicit_shapes object, the matrix that places it in the prim's space, and its mesh."""

    implicit: dict
    placed: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    indices: np.ndarray


def is_gprim(prim: Usd.Prim) -> bool:
    """Whether a prim is one of the shapes."""
    return prim.GetTypeName() in ("Sphere", "Cube", "Cylinder", "Cylinder_1", "Cone", "Capsule", "Capsule_1", "Plane")


def read_gprim(prim: Usd.Prim, time: Usd.TimeCode) -> Shape | None:
    """The shape of a gprim at one time; None if a size of it is no number."""
    for name in ("radius", "radiusTop", "radiusBottom", "size", "height", "width", "length"):
        value = prim.GetAttribute(name).Get(time) if prim.HasAttribute(name) else 0.0
        if not isinstance(value, (int, float)) or not 0 <= value < 1e15:
            return None
    kind = prim.GetTypeName().removesuffix("_1")

    def get(name: str, fallback: float) -> float:
        value = prim.GetAttribute(name).Get(time) if prim.HasAttribute(name) else None
        return fallback if value is None else value

    axis = _AXES.get(str(get("axis", "Z")), _AXES["Z"])
    if kind == "Sphere":
        r = float(get("radius", 1.0))
        return Shape({"type": "sphere", "sphere": {"radius": r}}, np.eye(4), *_lathe(_arc(0, np.pi, r, 0.0, r)))
    if kind == "Cube":
        s = float(get("size", 2.0))
        return Shape({"type": "box", "box": {"size": [s, s, s]}}, np.eye(4), *_box(s))
    if kind == "Plane":
        w, h = float(get("width", 2.0)), float(get("length", 2.0))
        # UsdGeomPlane: width along X and length along Z for axis Y; Z and Y for axis X; X and Y for axis Z.
        size = (h, w) if str(get("axis", "Z")) == "X" else (w, h)
        x, z = size[0] / 2, size[1] / 2
        points = np.array([[-x, 0, -z], [-x, 0, z], [x, 0, z], [x, 0, -z]])
        shape = {"type": "plane", "plane": {"sizeX": size[0], "sizeZ": size[1], "doubleSided": bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get())}}
        return Shape(shape, axis, points, np.tile([0.0, 1.0, 0.0], (4, 1)), np.array([0, 1, 2, 0, 2, 3]))
    height = float(get("height", 1.0 if kind == "Capsule" else 2.0))
    base = float(get("radius", 0.5 if kind == "Capsule" else 1.0))
    top, bottom = float(get("radiusTop", base)), float(get("radiusBottom", base))
    if kind == "Cone":
        top, bottom = 0.0, base
    size = {"height": height, "radiusTop": top, "radiusBottom": bottom}
    half = height / 2
    if kind == "Capsule":
        return _capsule(top, bottom, height, axis)
    slope = np.array([height, bottom - top]) / max(np.hypot(height, bottom - top), 1e-12)
    profile = np.array([
        [0, half, 0, 1], [top, half, 0, 1], [top, half, *slope], [bottom, -half, *slope], [bottom, -half, 0, -1], [0, -half, 0, -1],
    ])  # fmt: skip
    return Shape({"type": "cylinder", "cylinder": size}, axis, *_lathe(profile))


def _capsule(top: float, bottom: float, height: float, axis: np.ndarray) -> Shape:
    """USD's radii are those of the cone's ends, which the caps touch; KHR_implicit_shapes has the caps' own, and the distance of their centres."""
    slope = (bottom - top) / height if height > 0 else 0.0
    stretch = np.hypot(1, slope)
    upper, lower = height / 2 - top * slope, -height / 2 - bottom * slope
    placed = axis.copy()
    placed[:3, 3] = axis[:3, 1] * (upper + lower) / 2
    top, bottom, half = top * stretch, bottom * stretch, (upper - lower) / 2
    tilt = np.arctan(slope)
    profile = np.concatenate([_arc(0, np.pi / 2 - tilt, top, half, top), _arc(np.pi / 2 - tilt, np.pi, bottom, -half, bottom)])
    size = {"height": float(2 * half), "radiusTop": float(top), "radiusBottom": float(bottom)}
    return Shape({"type": "capsule", "capsule": size}, placed, *_lathe(profile))


def _arc(start: float, end: float, radius: float, centre: float, scale: float) -> np.ndarray:
    """Profile rows (radius, y, normal radius, normal y) of a circle from the pole down."""
    angle = np.linspace(start, end, max(int(_RINGS * (end - start) / np.pi), 2) + 1)
    return np.stack([radius * np.sin(angle), centre + scale * np.cos(angle), np.sin(angle), np.cos(angle)], axis=1)


def _lathe(profile: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Turn a profile from top to bottom around Y."""
    around = np.linspace(0, 2 * np.pi, _SEGMENTS + 1)
    c, s = np.cos(around), np.sin(around)
    c[-1], s[-1] = c[0], s[0]
    r, y, nr, ny = (profile[:, k, None] for k in range(4))
    points = np.stack([r * c, np.broadcast_to(y, r.shape[:1] + c.shape), -r * s], axis=2).reshape(-1, 3)
    normals = np.stack([nr * c, np.broadcast_to(ny, nr.shape[:1] + c.shape), -nr * s], axis=2).reshape(-1, 3)
    wide = _SEGMENTS + 1
    row, column = np.meshgrid(np.arange(len(profile) - 1), np.arange(_SEGMENTS), indexing="ij")
    a = (row * wide + column).reshape(-1)
    quads = np.stack([a, a + wide, a + wide + 1, a, a + wide + 1, a + 1], axis=1).reshape(-1, 3)
    p = points[quads]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    return points, normals, quads[area > 1e-14 * max(np.abs(points).max(), 1e-30) ** 2].reshape(-1)


def _box(s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points, normals, indices = [], [], []
    for axis in range(3):
        for sign in (1, -1):
            n = np.zeros(3)
            n[axis] = sign
            u, v = np.roll(np.eye(3), axis, axis=1)[1], np.roll(np.eye(3), axis, axis=1)[2]
            if sign < 0:
                u, v = v, u
            base = len(points) * 4
            points.append(s / 2 * np.array([n - u - v, n + u - v, n + u + v, n - u + v]))
            normals.append(np.tile(n, (4, 1)))
            indices += [base, base + 1, base + 2, base, base + 2, base + 3]
    return np.concatenate(points), np.concatenate(normals), np.array(indices)
