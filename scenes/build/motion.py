"""How far a camera moves its image: an estimate by casting a few rays."""

import numpy as np

from mesh import join, polygon, unit


def image_motion(positions, rotations, yfov, resolution, surface, ellipsoids=(), every=10, columns=24):
    """Mean displacement, in pixels a frame, of what is seen, for every `every`-th frame.

    Rays through a coarse grid of pixels are cast against the surface and the ellipsoids; where a point lands in the
    next frame tells how far it moves. Rays that hit nothing stand for what is infinitely far.
    """
    width, height = resolution
    rows = round(columns * height / width)
    focal = height / 2 / np.tan(yfov / 2)
    x, y = np.meshgrid((np.arange(columns) + 0.5) * width / columns, (np.arange(rows) + 0.5) * height / rows)
    pixels = np.column_stack([x.ravel() - width / 2, height / 2 - y.ravel()])
    rays = unit(np.column_stack([pixels / focal, -np.ones(len(pixels))]))
    corners = surface.positions[surface.triangles]
    moved = []
    for frame in range(0, len(positions) - 1, every):
        directions = rays @ rotations[frame].T
        reach = _triangle_distances(positions[frame], directions, corners)
        for ellipsoid in ellipsoids:
            reach = np.minimum(reach, _ellipsoid_distances(positions[frame], directions, ellipsoid))
        # Far points move as they would at any great distance.
        points = positions[frame] + directions * np.minimum(reach, 1e7)[:, None]
        seen = (points - positions[frame + 1]) @ rotations[frame + 1]
        ahead = seen[:, 2] < -1e-3
        landed = seen[ahead, :2] / -seen[ahead, 2:] * focal
        moved.append(np.linalg.norm(landed - pixels[ahead], axis=1).mean())
    return np.array(moved)


def surface_of(solids):
    """All faces of some solids as one surface."""
    return join(polygon(face) for solid in solids for face in solid.faces)


def _triangle_distances(eye, directions, corners):
    """Distance along each ray to the nearest triangle, infinite where there is none (Moeller and Trumbore)."""
    a, edge1, edge2 = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    offset = eye - a
    across = np.cross(offset, edge1)
    normal = np.cross(edge1, edge2)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = -1 / (directions @ normal.T)
        u = np.cross(offset, edge2) @ directions.T
        v = across @ directions.T
        u, v = -u.T * scale, v.T * scale
        t = np.sum(offset * normal, axis=1) * scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6)
    return np.where(hit, t, np.inf).min(axis=1)


def _ellipsoid_distances(eye, directions, ellipsoid):
    """Distance along each ray to an ellipsoid, infinite where it misses."""
    start = (eye - ellipsoid.centre) @ ellipsoid.rotation / ellipsoid.axes
    along = directions @ ellipsoid.rotation / ellipsoid.axes
    a, b, c = np.sum(along**2, axis=1), along @ start, start @ start - 1
    root = b * b - a * c
    t = (-b - np.sqrt(np.maximum(root, 0))) / a
    return np.where((root > 0) & (t > 0), t, np.inf)
