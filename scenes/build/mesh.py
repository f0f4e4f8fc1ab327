"""Triangle surfaces: the few shapes that all scenes are built from.

A `Surface` is the geometry of one glTF primitive: positions, normals, texture coordinates (in tiles of the texture)
and triangles. Y is up, a face shows its front counter-clockwise, lengths are metres.
"""

import itertools
from dataclasses import dataclass

import numpy as np


@dataclass
class Surface:
    """Triangles that share one material."""

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    triangles: np.ndarray

    def moved(self, translation=(0, 0, 0), turn=0.0, scale=(1, 1, 1)):
        """Scaled, then turned about Y by `turn` degrees, then translated."""
        rotation = rotation_y(turn)
        scale = np.broadcast_to(np.asarray(scale, float), 3)
        positions = (self.positions * scale) @ rotation.T + translation
        normals = unit((self.normals / scale) @ rotation.T)
        return Surface(positions, normals, self.uvs, self.triangles)

    def transformed(self, rotation, translation=(0, 0, 0)):
        """Turned by a 3x3 rotation matrix, then translated."""
        return Surface(self.positions @ rotation.T + translation, self.normals @ rotation.T, self.uvs, self.triangles)

    def tangents(self):
        """Tangents along growing U with the handedness in w, as glTF wants them for normal maps."""
        corners = self.positions[self.triangles]
        uvs = self.uvs[self.triangles]
        edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        (du1, dv1), (du2, dv2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
        sign = np.sign(du1 * dv2 - du2 * dv1)[:, None]
        along_u = (edge1 * dv2[:, None] - edge2 * dv1[:, None]) * sign
        along_v = (edge2 * du1[:, None] - edge1 * du2[:, None]) * sign
        tangent, bitangent = np.zeros_like(self.positions), np.zeros_like(self.positions)
        for corner in range(3):
            np.add.at(tangent, self.triangles[:, corner], along_u)
            np.add.at(bitangent, self.triangles[:, corner], along_v)
        tangent -= self.normals * np.sum(tangent * self.normals, axis=1, keepdims=True)
        # A pole has no direction of U: any tangent is as good there.
        lost = np.linalg.norm(tangent, axis=1) < 1e-9
        tangent[lost] = perpendicular(self.normals[lost])
        # Images grow downwards and glTF's green channel points up, so the bitangent is minus dP/dv.
        handed = np.sum(np.cross(self.normals, tangent) * -bitangent, axis=1)
        return np.column_stack([unit(tangent), np.where(handed < 0, -1.0, 1.0)])


def unit(vectors):
    """Vectors of length one."""
    vectors = np.asarray(vectors, float)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def perpendicular(normals):
    """For each normal some unit vector at right angles to it."""
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    return unit(np.cross(normals, helper)) if len(normals) else normals


def rotation_y(degrees):
    """Rotation about the vertical axis; +90 turns +z into +x."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def rotation_x(degrees):
    """Rotation about the x axis; +90 turns +y into +z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def rotation_z(degrees):
    """Rotation about the z axis; +90 turns +x into +y."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def join(surfaces):
    """One surface of many."""
    surfaces = list(surfaces)
    starts = np.cumsum([0] + [len(s.positions) for s in surfaces[:-1]])
    return Surface(
        np.concatenate([s.positions for s in surfaces]),
        np.concatenate([s.normals for s in surfaces]),
        np.concatenate([s.uvs for s in surfaces]),
        np.concatenate([s.triangles + start for s, start in zip(surfaces, starts, strict=True)]),
    )


def polygon(points, tile=1.0):
    """A flat convex polygon, its texture `tile` metres wide and upright where the polygon is."""
    points = np.asarray(points, float)
    normal = unit(np.cross(points[1] - points[0], points[2] - points[0]))
    if abs(normal[1]) > 0.9:
        across, up = np.array([1.0, 0, 0]), np.array([0, 0, -1.0])
    else:
        across = unit(np.cross([0, 1.0, 0], normal))
        up = np.cross(normal, across)
    uvs = np.column_stack([points @ across, -(points @ up)]) / tile
    fan = [[0, i, i + 1] for i in range(1, len(points) - 1)]
    return Surface(points, np.tile(normal, (len(points), 1)), uvs, np.array(fan))


def quad(a, b, c, d, tile=1.0):
    """A flat quadrilateral."""
    return polygon([a, b, c, d], tile)


def box(low, high, tile=1.0, skip=""):
    """An axis-aligned box without the sides named in `skip`: any of x X y Y z Z, small letters at the low end."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    sides = {
        "x": [(x0, y0, z0), (x0, y0, z1), (x0, y1, z1), (x0, y1, z0)],
        "X": [(x1, y0, z1), (x1, y0, z0), (x1, y1, z0), (x1, y1, z1)],
        "y": [(x0, y0, z0), (x1, y0, z0), (x1, y0, z1), (x0, y0, z1)],
        "Y": [(x0, y1, z1), (x1, y1, z1), (x1, y1, z0), (x0, y1, z0)],
        "z": [(x1, y0, z0), (x0, y0, z0), (x0, y1, z0), (x1, y1, z0)],
        "Z": [(x0, y0, z1), (x1, y0, z1), (x1, y1, z1), (x0, y1, z1)],
    }
    return join(polygon(corners, tile) for side, corners in sides.items() if side not in skip)


def strip(left, right, tile=1.0, smooth=False):
    """A band between two polylines of as many points; `smooth` shades it as one curved surface.

    Seen from its front, with the lines running upwards, `left` is on the left.
    """
    left, right = np.asarray(left, float), np.asarray(right, float)
    if not smooth:
        pairs = zip(left[:-1], right[:-1], right[1:], left[1:], strict=True)
        return join(polygon(corners, tile) for corners in pairs)
    steps = np.linalg.norm(np.diff(left, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    along = np.gradient(left, axis=0) + np.gradient(right, axis=0)
    normals = unit(np.cross(right - left, along))
    width = np.linalg.norm(right - left, axis=1)
    count = len(left)
    uvs = np.column_stack([np.tile(length, 2), np.concatenate([np.zeros(count), width])]) / tile
    first = np.arange(count - 1)
    triangles = np.concatenate(
        [
            np.column_stack([first, first + count, first + count + 1]),
            np.column_stack([first, first + count + 1, first + 1]),
        ]
    )
    return Surface(np.concatenate([left, right]), np.tile(normals, (2, 1)), uvs, triangles)


def lathe(profile, segments, tile=1.0):
    """A profile of (radius, height) points, bottom to top on the outside, turned about Y.

    The surface is smooth except where a profile point is given twice: there it has a crease.
    """
    profile = np.asarray(profile, float)
    breaks = [i + 1 for i in range(len(profile) - 1) if np.allclose(profile[i], profile[i + 1])]
    bounds = [0, *breaks, len(profile)]
    pieces = [_lathe_piece(profile[a:b], segments, tile) for a, b in itertools.pairwise(bounds)]
    return join(pieces)


def _lathe_piece(profile, segments, tile):
    slope = np.gradient(profile, axis=0)
    outward = unit(np.column_stack([slope[:, 1], -slope[:, 0]]))
    steps = np.linalg.norm(np.diff(profile, axis=0), axis=1)
    height = np.concatenate([[0.0], np.cumsum(steps)])
    # A whole number of tiles around, so that the texture closes.
    around = max(1, round(2 * np.pi * profile[:, 0].max() / tile))
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    flat = np.zeros_like(c)

    def turned(pairs):
        rows = np.stack([s * pairs[:, 0], flat + pairs[:, 1], c * pairs[:, 0]], axis=-1)
        return rows.reshape(-1, 3)

    u, v = np.broadcast_arrays(angle[:, None] / (2 * np.pi) * around, -height / tile)
    triangles = grid_triangles(segments, len(profile) - 1)
    positions = turned(profile)
    surface = Surface(positions, turned(outward), np.column_stack([u.ravel(), v.ravel()]), triangles)
    return without_slivers(surface)


def grid_triangles(columns, rows):
    """Triangles of a grid of vertices laid out column after column, `rows` + 1 to a column."""
    column, row = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    first = (column * (rows + 1) + row).ravel()
    after = first + rows + 1
    return np.concatenate([np.column_stack([first, after, after + 1]), np.column_stack([first, after + 1, first + 1])])


def without_slivers(surface):
    """The surface without triangles of no area, such as those at the poles of a lathe."""
    a, b, c = np.moveaxis(surface.positions[surface.triangles], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    surface.triangles = surface.triangles[area > 1e-10]
    return surface


def sphere(rings, segments, radius=1.0):
    """A sphere about the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    profile = np.column_stack([np.cos(angle), np.sin(angle)])
    profile[[0, -1], 0] = 0.0
    surface = lathe(profile, segments)
    # On a sphere the normal is the position itself.
    surface.normals = unit(surface.positions)
    return surface.moved(scale=(radius,) * 3)


def disc(radius, segments, height=0.0, tile=1.0):
    """A flat disc facing up."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    ring = np.column_stack([radius * np.sin(angle), np.full(segments, height), radius * np.cos(angle)])
    return polygon(ring, tile)


def wall(width, height, openings, depth, tile=1.0):
    """A wall in the plane z = 0 facing +z, from x = 0 and y = 0, with rectangular openings (x0, y0, x1, y1).

    The openings have jambs `depth` deep behind the wall.
    """
    xs = sorted({0.0, width, *(x for o in openings for x in (o[0], o[2]))})
    ys = sorted({0.0, height, *(y for o in openings for y in (o[1], o[3]))})
    cells = []
    for x0, x1 in itertools.pairwise(xs):
        for y0, y1 in itertools.pairwise(ys):
            inside = any(o[0] <= x0 and x1 <= o[2] and o[1] <= y0 and y1 <= o[3] for o in openings)
            if not inside:
                cells.append(quad((x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0), tile))
    for x0, y0, x1, y1 in openings:
        cells += [
            quad((x0, y0, 0), (x0, y0, -depth), (x0, y1, -depth), (x0, y1, 0), tile),
            quad((x1, y0, -depth), (x1, y0, 0), (x1, y1, 0), (x1, y1, -depth), tile),
            quad((x0, y1, -depth), (x1, y1, -depth), (x1, y1, 0), (x0, y1, 0), tile),
            quad((x0, y0, 0), (x1, y0, 0), (x1, y0, -depth), (x0, y0, -depth), tile),
        ]
    return join(cells)


def arch_points(span, spring, segments):
    """Points of a round arch of that span from (-span/2, spring) over the top to (+span/2, spring)."""
    angle = np.linspace(np.pi, 0, segments + 1)
    return np.column_stack([span / 2 * np.cos(angle), spring + span / 2 * np.sin(angle)])


def arch(span, bay, spring, height, depth, segments=24, tile=1.0):
    """One arcade bay above its columns: a round arch in a wall `bay` wide from `spring` to `height`.

    Centred on x = 0, faces at z = 0 and z = -depth.
    """
    curve = arch_points(span, spring, segments)
    front = np.column_stack([curve, np.zeros(len(curve))])
    back = front - [0, 0, depth]
    half, rib = bay / 2, span / 2
    top = np.column_stack([curve[:, 0], np.full(len(curve), height), np.zeros(len(curve))])
    faces = []
    for z, flip in ((0.0, False), (-depth, True)):
        low, high = front + [0, 0, z], top + [0, 0, z]
        piers = [
            [(-half, spring, z), (-rib, spring, z), (-rib, height, z), (-half, height, z)],
            [(rib, spring, z), (half, spring, z), (half, height, z), (rib, height, z)],
        ]
        cells = [[low[i], low[i + 1], high[i + 1], high[i]] for i in range(segments)] + piers
        faces += [polygon(cell[::-1] if flip else cell, tile) for cell in cells]
    soffit = strip(front, back, tile, smooth=True)
    under = [
        quad((x0, spring, -depth), (x1, spring, -depth), (x1, spring, 0), (x0, spring, 0), tile)
        for x0, x1 in ((-half, -rib), (rib, half))
    ]
    return join([*faces, soffit, *under])


def cards(centres, normals, size, random):
    """Square leaf cards about `centres`, turned at random, shaded with the given normals."""
    count = len(centres)
    across = unit(random.normal(size=(count, 3)))
    facing = unit(normals + 0.7 * random.normal(size=(count, 3)))
    across = unit(across - facing * np.sum(across * facing, axis=1, keepdims=True))
    up = np.cross(facing, across)
    half = (0.5 * np.asarray(size))[..., None] * np.ones((count, 1))
    corners = [centres + half * (a * across + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    positions = np.stack(corners, axis=1).reshape(-1, 3)
    uvs = np.tile([[0, 1], [1, 1], [1, 0], [0, 0]], (count, 1)).astype(float)
    first = 4 * np.arange(count)[:, None]
    triangles = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]])
    return Surface(positions, np.repeat(normals, 4, axis=0), uvs, triangles)
