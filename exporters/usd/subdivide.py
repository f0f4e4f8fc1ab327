"""Catmull-Clark subdivision with semi-sharp creases and corners, as UsdGeomMesh asks for it.

The rules are those of DeRose, Kass, Truong, "Subdivision Surfaces in Character Animation" (1998), with OpenSubdiv's
boundary rule `edgeAndCorner` (USD's default) or `edgeOnly`, its blending of fractional sharpness, and uniform creasing
(sharpness falls by one a level; 10 and more stays sharp for ever). Values at points follow the rules of the points;
those at corners (varying) are interpolated linearly within each face. Face-varying values are meshes of their own, cut
open where neighbouring faces disagree, which UsdGeomMesh.faceVaryingLinearInterpolation then treats as boundaries.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

INFINITE = 10.0


@dataclass
class Polygons:
    """A mesh of faces with any number of corners; all arrays are numpy."""

    points: np.ndarray
    counts: np.ndarray
    corners: np.ndarray
    # Which face of the first mesh each face comes from.
    parents: np.ndarray
    # Sharp edges (m, 2) of point numbers, their sharpness (m,), and the sharpness of each point.
    edges: np.ndarray = field(default_factory=lambda: np.empty((0, 2), int))
    sharpness: np.ndarray = field(default_factory=lambda: np.empty(0))
    point_sharpness: np.ndarray | None = None
    # Values at points (n, k) and at corners (len(corners), k), by name.
    vertex: dict[str, np.ndarray] = field(default_factory=dict)
    corner: dict[str, np.ndarray] = field(default_factory=dict)
    # Face-varying values: meshes of the same faces whose points are the values.
    seamed: dict[str, Polygons] = field(default_factory=dict)


def face_varying(mesh: Polygons, values: np.ndarray, rule: str) -> Polygons:
    """Values at corners as a mesh to subdivide beside theirs.

    What stays where it is: nothing but corners for `cornersOnly` (and `none`), also where three regions meet for
    `cornersPlus1` (and `cornersPlus2`), all along seams for `boundaries`.
    """
    rows = np.concatenate([mesh.corners[:, None].astype(float), np.round(values, 7)], axis=1)
    _, first, joined = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    joined, at = joined.reshape(-1), mesh.corners[first]
    out = Polygons(values[first], mesh.counts, joined, mesh.parents)
    following = _following(mesh.counts)
    pairs = np.stack([joined, joined[following]], axis=1)
    if len(mesh.edges):
        theirs = np.stack([mesh.corners, mesh.corners[following]], axis=1)
        edges, number = np.unique(np.sort(theirs, axis=1), axis=0, return_inverse=True)
        out.edges, out.sharpness = pairs, _edge_sharpness(mesh, edges, len(mesh.points))[number.reshape(-1)]
    own = mesh.point_sharpness[at].copy() if mesh.point_sharpness is not None else np.zeros(len(at))
    if rule not in ("none", "cornersOnly"):
        own[np.bincount(at)[at] > 2] = INFINITE
    if rule == "boundaries":
        edges, uses = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
        own[edges[uses != 2].reshape(-1)] = INFINITE
    out.point_sharpness = own
    return out


def _following(counts: np.ndarray) -> np.ndarray:
    """For each corner the next one of its face."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    following = np.arange(counts.sum()) + 1
    following[starts + counts - 1] = starts
    return following


def catmull_clark(mesh: Polygons, corners_sharp: bool = True) -> Polygons:
    """One level. `corners_sharp`: points of the boundary that only one face has stay where they are."""
    points, counts, corners = mesh.points, mesh.counts, mesh.corners
    faces, n = len(counts), len(points)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    face_of = np.repeat(np.arange(faces), counts)
    following = _following(counts)
    pairs = np.sort(np.stack([corners, corners[following]], axis=1), axis=1)
    edges, edge_of = np.unique(pairs, axis=0, return_inverse=True)
    edge_of = edge_of.reshape(-1)
    uses = np.bincount(edge_of, minlength=len(edges))
    sharp = _edge_sharpness(mesh, edges, n)
    sharp[uses != 2] = INFINITE

    def refine(values: np.ndarray) -> np.ndarray:
        centres = _mean(values[corners], face_of, faces, counts)
        mids = values[edges].mean(axis=1)
        around = _sum(centres[face_of], edge_of, len(edges))
        smooth = (mids * 2 + around) / 4
        s = np.clip(sharp, 0, 1)[:, None]
        return np.concatenate([points_rule(values, centres, mids), np.where(uses[:, None] == 2, smooth + (mids - smooth) * s, mids), centres])

    valence = np.bincount(edges.reshape(-1), minlength=n)
    face_count = np.bincount(corners, minlength=n)
    own = mesh.point_sharpness.copy() if mesh.point_sharpness is not None else np.zeros(n)
    if corners_sharp:
        own[(face_count == 1) & (np.bincount(edges[uses != 2].reshape(-1), minlength=n) == 2)] = INFINITE
    later, own_later = _next(sharp), _next(own)
    # Where a point's rule changes with the coming level, both rules are blended by how sharp what smooths out was.
    fading = sharp * (later <= 0)
    count = np.bincount(edges[fading > 0].reshape(-1), minlength=n) + ((own > 0) & (own_later <= 0))
    total = _sum(np.repeat(fading, 2), edges.reshape(-1), n)[:, 0] + own * (own_later <= 0)
    share = np.clip(total / np.maximum(count, 1), 0, 1)[:, None]

    def points_rule(values: np.ndarray, centres: np.ndarray, mids: np.ndarray) -> np.ndarray:
        k = np.maximum(valence, 1)[:, None]
        q = _sum(centres[face_of], corners, n) / np.maximum(face_count, 1)[:, None]
        r = _sum(np.repeat(mids, 2, axis=0), edges.reshape(-1), n) / k
        smooth = (q + 2 * r + (k - 3) * values) / k

        def by_rule(edge_sharp: np.ndarray, point_sharp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            ends = edges[edge_sharp > 0]
            creases = np.bincount(ends.reshape(-1), minlength=n)
            others = _sum(np.concatenate([values[ends[:, 1]], values[ends[:, 0]]]), np.concatenate([ends[:, 0], ends[:, 1]]), n)
            rule = np.where((point_sharp > 0) | (creases > 2), 2, creases == 2)
            out = np.where((rule == 1)[:, None], (6 * values + others) / 8, smooth)
            return np.where((rule == 2)[:, None], values, out), rule

        now, rule = by_rule(sharp, own)
        then, rule_then = by_rule(later, own_later)
        changes = ((rule > 0) & (rule_then != rule))[:, None]
        out = np.where(changes, then + (now - then) * share, now)
        return np.where((valence == 0)[:, None], values, out)

    previous = np.arange(len(corners)) - 1
    previous[starts] = starts + counts - 1
    quads = np.stack([corners, n + edge_of, n + len(edges) + face_of, n + edge_of[previous]], axis=1)
    child = Polygons(
        points=refine(points),
        counts=np.full(len(quads), 4),
        corners=quads.reshape(-1),
        parents=mesh.parents[face_of],
        vertex={k: refine(v) for k, v in mesh.vertex.items()},
        seamed={k: catmull_clark(v) for k, v in mesh.seamed.items()},
    )
    for name, values in mesh.corner.items():
        centres = _mean(values, face_of, faces, counts)[face_of]
        half, back = (values + values[following]) / 2, (values + values[previous]) / 2
        child.corner[name] = np.stack([values, half, centres, back], axis=1).reshape(-1, values.shape[1])
    kept = (later > 0) & (uses == 2)
    new = n + np.flatnonzero(kept)
    child.edges = np.concatenate([np.stack([edges[kept, 0], new], axis=1), np.stack([new, edges[kept, 1]], axis=1)])
    child.sharpness = np.concatenate([later[kept], later[kept]])
    child.point_sharpness = np.zeros(len(child.points))
    child.point_sharpness[:n] = own_later
    return child


def _next(sharpness: np.ndarray) -> np.ndarray:
    """Sharpness one level on."""
    return np.where(sharpness >= INFINITE, sharpness, np.maximum(sharpness - 1, 0))


def smooth_normals(mesh: Polygons) -> np.ndarray:
    """Normals at corners: angle-weighted over the faces around, not across sharp edges or the boundary."""
    points, corners = mesh.points, mesh.corners
    faces = len(mesh.counts)
    starts = np.concatenate([[0], np.cumsum(mesh.counts)[:-1]])
    face_of = np.repeat(np.arange(faces), mesh.counts)
    following = _following(mesh.counts)
    previous = np.arange(len(corners)) - 1
    previous[starts] = starts + mesh.counts - 1
    here, ahead, behind = points[corners], points[corners[following]], points[corners[previous]]
    newell = _sum(np.cross(here, ahead), face_of, faces)
    newell /= np.maximum(np.linalg.norm(newell, axis=1, keepdims=True), 1e-30)
    a, b = ahead - here, behind - here
    cosine = (a * b).sum(axis=1) / np.maximum(np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1), 1e-30)
    weighted = newell[face_of] * np.arccos(np.clip(cosine, -1, 1))[:, None]
    group = _fans(mesh, following, len(points)) if len(mesh.edges) else corners
    total = _sum(weighted, group, int(group.max(initial=-1)) + 1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    normals = np.where(length > 1e-20, total / np.maximum(length, 1e-30), 0)[group]
    flat = ~normals.any(axis=1)
    normals[flat] = newell[face_of][flat]
    normals[~normals.any(axis=1)] = (0, 1, 0)
    return normals


def _fans(mesh: Polygons, following: np.ndarray, n: int) -> np.ndarray:
    """A number for each corner, equal for corners of one point that are joined without crossing a sharp edge."""
    corners = mesh.corners
    pairs = np.sort(np.stack([corners, corners[following]], axis=1), axis=1)
    edges, edge_of = np.unique(pairs, axis=0, return_inverse=True)
    edge_of = edge_of.reshape(-1)
    sharp = _edge_sharpness(mesh, edges, n)
    order = np.argsort(edge_of, kind="stable")
    same = (edge_of[order][1:] == edge_of[order][:-1]) & (sharp[edge_of[order][1:]] <= 0)
    first, second = order[:-1][same], order[1:][same]
    links = []
    for i, j in ((first, second), (first, following[second]), (following[first], second), (following[first], following[second])):
        match = corners[i] == corners[j]
        links.append(np.stack([i[match], j[match]], axis=1))
    links = np.concatenate(links)
    label = np.arange(len(corners))
    while len(links):
        low = np.minimum(label[links[:, 0]], label[links[:, 1]])
        new = label.copy()
        np.minimum.at(new, links[:, 0], low)
        np.minimum.at(new, links[:, 1], low)
        if (new == label).all():
            break
        label = new
    return label


def _edge_sharpness(mesh: Polygons, edges: np.ndarray, n: int) -> np.ndarray:
    """Sharpness of each of `edges` (sorted pairs, sorted rows)."""
    out = np.zeros(len(edges))
    if len(mesh.edges):
        keys = edges[:, 0].astype(np.int64) * n + edges[:, 1]
        wanted = np.sort(mesh.edges, axis=1)
        wanted = wanted[:, 0].astype(np.int64) * n + wanted[:, 1]
        at = np.clip(np.searchsorted(keys, wanted), 0, max(len(keys) - 1, 0))
        hit = keys[at] == wanted
        np.maximum.at(out, at[hit], mesh.sharpness[hit])
    return out


def _sum(values: np.ndarray, index: np.ndarray, size: int) -> np.ndarray:
    values = values[:, None] if values.ndim == 1 else values
    return np.stack([np.bincount(index, values[:, k], minlength=size) for k in range(values.shape[1])], axis=1)


def _mean(values: np.ndarray, index: np.ndarray, size: int, counts: np.ndarray) -> np.ndarray:
    return _sum(values, index, size) / np.maximum(counts, 1)[:, None]
