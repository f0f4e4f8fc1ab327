"""Our Catmull-Clark against Blender's, which is OpenSubdiv."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")

from exporters.usd.subdivide import Polygons, catmull_clark, smooth_normals

CUBE = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1]

# Creases as Blender has them (0-1; sharpness is 10 times the square), corners likewise, and which faces there are.
CASES = {
    "smooth": ({}, {}, FACES),
    "one edge": ({(0, 1): 1.0}, {}, FACES),
    "a ring": ({(0, 1): 1.0, (1, 3): 1.0, (2, 3): 1.0, (0, 2): 1.0}, {}, FACES),
    "a half-sharp ring": ({(0, 1): 0.4, (1, 3): 0.4, (2, 3): 0.4, (0, 2): 0.4}, {}, FACES),
    "all sharp": (dict.fromkeys(EDGES, 1.0), {}, FACES),
    "all a little": (dict.fromkeys(EDGES, 0.5), {}, FACES),
    "uneven": ({e: 0.2 + 0.06 * i for i, e in enumerate(EDGES)}, {}, FACES),
    "a corner": ({}, {0: 1.0}, FACES),
    "open box": ({}, {}, FACES[:5]),
    "open box with creases": ({(0, 1): 0.45, (4, 5): 1.0}, {}, FACES[:5]),
    "single quad": ({}, {}, FACES[:1]),
    "triangles": ({}, {}, [(0, 1, 3), (0, 3, 2), *FACES[1:]]),
}


def ours(creases, corners, faces, levels):
    """Points after some levels."""
    used = sorted({v for f in faces for v in f})
    number = {v: i for i, v in enumerate(used)}
    edges = [(number[a], number[b]) for a, b in creases]
    mesh = Polygons(CUBE[used], np.array([len(f) for f in faces]), np.array([number[v] for f in faces for v in f]), np.arange(len(faces)))
    if edges:
        mesh.edges, mesh.sharpness = np.array(edges), np.array([10 * c * c for c in creases.values()])
    mesh.point_sharpness = np.array([10 * corners.get(v, 0.0) ** 2 for v in used])
    for _ in range(levels):
        mesh = catmull_clark(mesh)
    return mesh


def theirs(bpy, creases, corners, faces, levels):
    """Blender's points after some levels."""
    import blender_scene as b

    used = sorted({v for f in faces for v in f})
    number = {v: i for i, v in enumerate(used)}
    ob = b.mesh("Cage", CUBE[used].tolist(), [tuple(number[v] for v in f) for f in faces])
    data = ob.data
    sharp = data.attributes.new("crease_edge", "FLOAT", "EDGE")
    for edge in data.edges:
        key = tuple(sorted(used[v] for v in edge.vertices))
        sharp.data[edge.index].value = creases.get(key, 0.0)
    points = data.attributes.new("crease_vert", "FLOAT", "POINT")
    for v in used:
        points.data[number[v]].value = corners.get(v, 0.0)
    modifier = ob.modifiers.new("s", "SUBSURF")
    modifier.levels, modifier.use_limit_surface, modifier.boundary_smooth = levels, False, "PRESERVE_CORNERS"
    evaluated = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return np.array([v.co for v in evaluated.vertices])


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("case", CASES)
def test_points_agree_with_opensubdiv(blender, case, levels):
    got = ours(*CASES[case], levels).points
    want = theirs(blender, *CASES[case], levels)
    assert len(got) == len(want)
    distance = np.linalg.norm(got[:, None] - want[None], axis=2)
    assert distance.min(axis=1).max() < 1e-5
    assert distance.min(axis=0).max() < 1e-5


def test_normals_are_smooth_and_stop_at_creases():
    """All edges of a cube sharp: flat sides. None: normals near those of a ball."""
    hard = ours(dict.fromkeys(EDGES, 1.0), {}, FACES, 2)
    assert np.abs(smooth_normals(hard)).max(axis=1) == pytest.approx(np.ones(len(hard.corners)))
    soft = ours({}, {}, FACES, 3)
    points = soft.points[soft.corners]
    cosine = (smooth_normals(soft) * points).sum(axis=1) / np.linalg.norm(points, axis=1)
    assert cosine.min() > 0.97
