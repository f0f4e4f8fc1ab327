"""Polygons to triangles."""

from __future__ import annotations

import numpy as np
import pytest
from exporters.usd.triangulate import triangulate

SHAPES = {
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "dart": [(0, 0), (2, -1), (1, 0), (2, 1)],
    "L": [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)],
    "U": [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)],
    "star": [(np.cos(a) * r, np.sin(a) * r) for a, r in zip(np.arange(10) * np.pi / 5, [1, 0.3] * 5, strict=True)],
    "straight corners": [(0, 0), (1, 0), (2, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 2), (1, 3), (0, 3), (0, 1)],
    "comb": [*[(x / 2, y) for x in range(40) for y in ((0, 2) if x % 2 else (2, 0))][1:-1], (19.5, -1), (0, -1)],
    "hole by a seam": [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)],
    "twice the same point": [(0, 0), (3, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)],
    "spiral": [(0, 0), (5, 0), (5, 5), (1, 5), (1, 2), (3, 2), (3, 3), (2, 3), (2, 4), (4, 4), (4, 1), (0, 1)],
}


def signed(p):
    """Signed areas of triangles (n, 3, 2)."""
    u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def area(p):
    """Signed area of a polygon."""
    q = np.roll(p, -1, axis=0)
    return (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_triangles_fill_the_polygon_once(shape, turned):
    """None is turned over, and their areas add up: so none overlaps another. From any corner on, in any plane."""
    flat = np.array(SHAPES[shape], dtype=float)
    if turned:
        flat = flat[::-1]
    sign = np.sign(area(flat))
    frame = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    for first in range(len(flat)):
        p = np.roll(flat, first, axis=0)
        triangles = triangulate(np.pad(p, ((0, 0), (0, 1))) @ frame.T, np.arange(len(p)), np.array([len(p)]))
        assert len(triangles) == len(p) - 2
        areas = signed(p[triangles]) * sign
        assert areas.min() > -1e-9
        assert areas.sum() == pytest.approx(abs(area(flat)))


def test_many_faces_at_once():
    """Fans from the first corner where faces are convex; every face has its own triangles."""
    points, corners, counts = [], [], []
    names = ("square", "L", "square", "star", "dart")
    for name in names:
        corners += range(len(points), len(points) + len(SHAPES[name]))
        points += [(x, y, 0) for x, y in SHAPES[name]]
        counts.append(len(SHAPES[name]))
    corners = np.array(corners)[::-1].copy()
    triangles = triangulate(np.array(points, float), corners, np.array(counts[::-1]))
    ends = np.cumsum(counts[::-1])
    assert (np.searchsorted(ends, triangles, side="right") == np.searchsorted(ends, triangles[:, :1], side="right")).all()
    got = np.abs(signed(np.array(points, float)[corners[triangles]][..., :2])).sum()
    assert got == pytest.approx(sum(abs(area(np.array(SHAPES[n]))) for n in names))
    n = len(corners)
    assert triangles[-2:].tolist() == [[n - 4, n - 3, n - 2], [n - 4, n - 2, n - 1]]


KNOT = np.array([(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 2, 0), (1, 5, 0)])


@pytest.mark.parametrize("p", [np.zeros((6, 3)), np.outer([0, 2, 1, 3, 1, 2], (1, 2, 3)), KNOT])
def test_what_is_no_simple_polygon_has_as_many_triangles(p):
    """A point, a line, a knot."""
    triangles = triangulate(p.astype(float), np.arange(len(p)), np.array([len(p)]))
    assert triangles.shape == (len(p) - 2, 3)


def test_bent_polygons():
    """A U whose arms stand up: seen along its normal it is still filled once."""
    p = np.array([(x, y, max(y - 1, 0) * 0.5) for x, y in SHAPES["U"]], float)
    triangles = p[triangulate(p, np.arange(8), np.array([8]))]
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(3 + 4 * np.hypot(1, 0.5), rel=0.05)
