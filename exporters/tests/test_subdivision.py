"""Our Catmull-Clark against Blender's, which is OpenSubdiv."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")

from exporters.usd.subdivide import Polygons, catmull_clark, face_varying, smooth_normals

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


def islands(faces):
    """Texture coordinates of a cube's corners: each side for itself."""
    return [(2 * f + x, y) for f in range(len(faces)) for x, y in ((0, 0), (0, 1), (1, 1), (1, 0))]


def net(faces, lid=3):
    """Unfolded around the side of the points 0 to 3 and bent a little; the lid hangs on a side, or lies farther out by itself."""
    out = []
    for face in faces:
        low = [v for v in face if v < 4]
        for v in face:
            y, z = (1 if v & 2 else -1), (1 if v & 1 else -1)
            if not low:
                y = lid if v & 2 else lid + 2
            elif v & 4:
                y, z = (3 * y, z) if (low[0] ^ low[1]) == 1 else (y, 3 * z)
            out.append((y + 0.1 * z * z, z + 0.05 * y * y))
    return out


def net_and_lid(faces):
    """Three regions meet at its corners."""
    return net(faces, lid=4)


RULES = {"cornersOnly": "PRESERVE_CORNERS", "cornersPlus1": "PRESERVE_CORNERS_AND_JUNCTIONS", "boundaries": "PRESERVE_BOUNDARIES"}


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("layout", [islands, net, net_and_lid])
@pytest.mark.parametrize("case", ["smooth", "one edge", "open box"])
def test_face_varying_values_agree_with_opensubdiv(blender, case, layout, rule):
    """Texture coordinates at every corner of two levels."""
    import blender_scene as b

    creases, _, faces = CASES[case]
    coordinates = np.array(layout(faces))
    mesh = ours({}, {}, faces, 0)
    if creases:
        mesh.edges, mesh.sharpness = np.array(list(creases)), np.full(len(creases), 10.0)
    mesh.seamed["st"] = face_varying(mesh, coordinates, rule)
    for _ in range(2):
        mesh = catmull_clark(mesh)
    got = np.concatenate([mesh.points[mesh.corners], mesh.seamed["st"].points[mesh.seamed["st"].corners]], axis=1)
    ob = b.mesh("Cage", CUBE.tolist(), faces)
    layer = ob.data.uv_layers.new(name="st")
    layer.data.foreach_set("uv", coordinates.astype(np.float32).reshape(-1))
    sharp = ob.data.attributes.new("crease_edge", "FLOAT", "EDGE")
    for edge in ob.data.edges:
        sharp.data[edge.index].value = creases.get(tuple(sorted(edge.vertices)), 0.0)
    modifier = ob.modifiers.new("s", "SUBSURF")
    modifier.levels, modifier.use_limit_surface, modifier.boundary_smooth, modifier.uv_smooth = 2, False, "PRESERVE_CORNERS", RULES[rule]
    data = ob.evaluated_get(blender.context.evaluated_depsgraph_get()).data
    want = np.array([(*data.vertices[loop.vertex_index].co, *data.uv_layers[0].data[loop.index].uv) for loop in data.loops])
    assert len(got) == len(want)
    distance = np.linalg.norm(got[:, None] - want[None], axis=2)
    assert distance.min(axis=1).max() < 1e-5
    assert distance.min(axis=0).max() < 1e-5
