"""Polygons to triangles: fans where they are convex, ear clipping where more than one corner is reflex.

A polygon with one reflex corner is a fan too, from that corner: everything is seen from there.
"""

from __future__ import annotations

import numpy as np

# Sine of the angle by which a corner has to turn back: less is rounding.
_STRAIGHT = 1e-6

# So near to a triangle's edge, as a share of its size, a point lies on it: the rest is rounding, which differs from machine to machine.
_ON_EDGE = 1e-9


def triangulate(points: np.ndarray, corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Of faces with `counts` corners each (3 or more): triangles (n, 3) of numbers into `corners`."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    face_of = np.repeat(np.arange(len(counts)), counts)
    reflex = _reflex(points[corners], starts, counts, face_of) if (counts > 3).any() else np.zeros(len(corners), dtype=bool)
    many = np.bincount(face_of, reflex, minlength=len(counts))
    first = np.zeros(len(counts), dtype=int)
    hollow = reflex & (many == 1)[face_of]
    first[face_of[hollow]] = np.flatnonzero(hollow) - starts[face_of[hollow]]
    fans = np.repeat(np.arange(len(counts)), counts - 2)
    step = np.arange(len(fans)) - np.repeat(np.concatenate([[0], np.cumsum(counts - 2)[:-1]]), counts - 2)
    triangles = starts[fans, None] + (first[fans, None] + np.stack([step * 0, step + 1, step + 2], axis=1)) % counts[fans, None]
    for face in np.flatnonzero(many > 1):
        within = np.arange(starts[face], starts[face] + counts[face])
        triangles[fans == face] = within[_ears(_flat(points[corners[within]]))]
    return triangles


def _reflex(p: np.ndarray, starts: np.ndarray, counts: np.ndarray, face_of: np.ndarray) -> np.ndarray:
    """Which corners turn against their face."""
    following = np.arange(len(p)) + 1
    following[starts + counts - 1] = starts
    previous = np.empty_like(following)
    previous[following] = np.arange(len(p))
    around = p - p[starts][face_of]
    area = np.cross(around, around[following])
    normals = np.stack([np.bincount(face_of, area[:, k], minlength=len(counts)) for k in range(3)], axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    before, after = p - p[previous], p[following] - p
    turn = (np.cross(before, after) * normals[face_of]).sum(axis=1)
    return turn < -_STRAIGHT * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)


def _flat(p: np.ndarray) -> np.ndarray:
    """A polygon seen along its normal, counterclockwise."""
    around = p - p[0]
    normal = np.cross(around, np.roll(around, -1, axis=0)).sum(axis=0)
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= max(np.linalg.norm(u), 1e-300)
    v = np.cross(normal / max(np.linalg.norm(normal), 1e-300), u)
    return np.stack([around @ u, around @ v], axis=1)


def _ears(p: np.ndarray) -> np.ndarray:
    """Triangles of a simple polygon (n, 2); of one that crosses itself, as many."""
    left, out = np.arange(len(p)), []
    while len(left) > 3:
        before, after = np.roll(left, 1), np.roll(left, -1)
        a, b, c = p[before], p[left], p[after]
        turn = _turn(a, b, c)
        size = np.linalg.norm(b - a, axis=1) * np.linalg.norm(c - b, axis=1)
        rest = p[left[turn < _STRAIGHT * size]]
        convex = np.flatnonzero(turn > _STRAIGHT * size)
        ear = next((k for k in convex if not _holds(a[k], b[k], c[k], rest)), int(np.argmax(turn)))
        out.append((before[ear], left[ear], after[ear]))
        left = np.delete(left, ear)
    return np.array([*out, left])


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Twice the area of triangles, positive where they are counterclockwise."""
    u, v = b - a, c - a
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _holds(a: np.ndarray, b: np.ndarray, c: np.ndarray, points: np.ndarray) -> bool:
    """Whether a triangle holds one of the points other than its corners."""
    outside = -_ON_EDGE * np.abs([b - a, c - a]).max() ** 2
    inside = (_turn(a, b, points) >= outside) & (_turn(b, c, points) >= outside) & (_turn(c, a, points) >= outside)
    own = (points == a).all(axis=1) | (points == b).all(axis=1) | (points == c).all(axis=1)
    return bool((inside & ~own).any())
