"""Sampled movement: where to sample, matrices to node transforms, values to glTF animation channels.

glTF nodes hold translation, rotation and scale, so a sheared matrix (a rotated child of an unevenly scaled parent)
has to be split over two nodes: M = T * U * S * V^T by singular value decomposition, (T, U, S) above, V^T below.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from .document import Document

# Rotation error in radians that sub-frame samples keep linear interpolation under: half a pixel of a 2000 pixel wide
# picture with a field of view of 60 degrees.
ANGLE_TOLERANCE = 2.5e-4
MAX_STEPS = 8
_SHEAR = 2e-5
_SAME = 1e-7
# How thick what is flat becomes, of its greatest scale: single precision leaves less than that of a scale of 0 that is turned.
_THIN = 1e-6


def steps_between(poses: np.ndarray, size: float) -> np.ndarray:
    """How many samples each interval of whole frames needs (1, 2, 4 or 8).

    `poses` is (frames, objects, 4, 4) without scale in mind; linear interpolation over an interval is off by an eighth
    of the second difference, and n samples divide that by n squared. `size` is the extent of the scene: a thousandth
    of it is the tolerance for positions.
    """
    frames = poses.shape[0]
    need = np.ones(max(frames - 1, 0), dtype=int)
    if frames < 3 or poses.shape[1] == 0:
        return need
    second = poses[2:] - 2 * poses[1:-1] + poses[:-2]
    moved = np.abs(second[..., :3, 3]).max(axis=(1, 2)) / 8 / max(size * 1e-3, 1e-9)
    scale = np.maximum(np.linalg.norm(poses[1:-1, :, :3, :3], axis=2).max(axis=2), 1e-12)
    turned = (np.abs(second[..., :3, :3]).max(axis=(2, 3)) / scale).max(axis=1) / 8 / ANGLE_TOLERANCE
    error = np.maximum(moved, turned)
    for i, e in enumerate(error):
        n = 1
        while n < MAX_STEPS and e > n * n:
            n *= 2
        need[i] = max(need[i], n)
        need[i + 1] = max(need[i + 1], n)
    return need


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) as unit quaternions xyzw, each on the same side as the one before."""
    out = np.empty((len(matrices), 4))
    for i, m in enumerate(matrices):
        # The largest of the four squared components decides the formula (Shepperd), so nothing is divided by a small one.
        squares = np.array([m[0, 0], m[1, 1], m[2, 2], m[0, 0] + m[1, 1] + m[2, 2]])
        k = int(np.argmax(squares))
        if k == 3:
            q = [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + squares[3]]
        else:
            a, b, c = k, (k + 1) % 3, (k + 2) % 3
            q = [0.0, 0.0, 0.0, m[c, b] - m[b, c]]
            q[a] = 1 + m[a, a] - m[b, b] - m[c, c]
            q[b] = m[b, a] + m[a, b]
            q[c] = m[c, a] + m[a, c]
        q = np.asarray(q) / np.linalg.norm(q)
        out[i] = -q if i and np.dot(q, out[i - 1]) < 0 else q
    return out


def is_sheared(matrices: np.ndarray) -> bool:
    """Whether any of (n, 4, 4) cannot be written as translation, rotation and scale."""
    linear = matrices[:, :3, :3]
    lengths = np.maximum(np.linalg.norm(linear, axis=1, keepdims=True), 1e-30)
    unit = linear / lengths
    gram = np.einsum("nki,nkj->nij", unit, unit)
    off = np.abs(gram * (1 - np.eye(3)))
    # A collapsed axis (scale 0) has no direction that could be sheared.
    alive = (lengths[:, 0, :] > 1e-12).astype(float)
    return bool((off * alive[:, :, None] * alive[:, None, :]).max(initial=0) > _SHEAR)


def split_trs(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Translations, rotations (3x3) and scales of unsheared matrices (n, 4, 4)."""
    linear = matrices[:, :3, :3]
    scales = np.linalg.norm(linear, axis=1)
    mirrored = np.linalg.det(linear) < 0
    scales[mirrored] *= -1
    rotations = np.empty_like(linear)
    for i, (m, s) in enumerate(zip(linear, scales, strict=True)):
        if np.abs(s).min() > 1e-12:
            rotations[i] = m / s
        else:
            u, _, vt = np.linalg.svd(m)
            rotations[i] = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    return matrices[:, :3, 3], rotations, scales


def thickened(matrices: np.ndarray) -> np.ndarray:
    """Matrices (n, 4, 4) that can be inverted, as a renderer does: what a scale of 0 has made flat is thin. What is a line is not seen."""
    out = np.array(matrices, dtype=float)
    side = -1.0 if np.linalg.det(out[:, :3, :3]).sum() < 0 else 1.0
    u, scales, vt = np.linalg.svd(out[:, :3, :3])
    thin = _THIN * scales[:, 0]
    for i in np.flatnonzero((scales[:, 2] < thin) & (thin > 0)):
        third = side * np.linalg.det(u[i] @ vt[i]) * thin[i]
        out[i, :3, :3] = u[i] @ np.diag([*scales[i, :2], third]) @ vt[i] if scales[i, 1] >= thin[i] else 0
    return out


_TURNS = [
    np.eye(3)[list(p)] * np.array(s)[:, None]
    for p in permutations(range(3))
    for s in product((1, -1), repeat=3)
    if np.linalg.det(np.eye(3)[list(p)] * np.array(s)[:, None]) > 0
]


def split_sheared(matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (n, 4, 4) as products of two unsheared ones: (T U S) and (V^T), steady from frame to frame."""
    upper, lower = np.tile(np.eye(4), (2, len(matrices), 1, 1))
    last = np.eye(3)
    for i, m in enumerate(matrices):
        u, s, vt = np.linalg.svd(m[:3, :3])
        if np.linalg.det(vt) < 0:
            vt, s = -vt, -s
        if np.linalg.det(u) < 0:
            u, s = -u, -s
        turn = max(_TURNS, key=lambda q: np.trace(last @ (q @ vt).T))
        last = turn @ vt
        upper[i, :3, :3] = u @ np.diag(s) @ turn.T
        upper[i, :3, 3] = m[:3, 3]
        lower[i, :3, :3] = last
    return upper, lower


def unscaled(world: np.ndarray) -> np.ndarray:
    """A matrix without scale and shear, for cameras and lights: -Z keeps its direction exactly, +Y its side.

    What renderers do: position and direction count. A matrix that is flat in a needed direction keeps the axis it had.
    """
    out = np.eye(4)
    out[:3, 3] = world[:3, 3]
    length = np.linalg.norm(world[:3, 2])
    back = world[:3, 2] / length if length > 1e-20 else np.array([0.0, 0.0, 1.0])
    up = world[:3, 1] - back * np.dot(back, world[:3, 1])
    length = np.linalg.norm(up)
    if length < 1e-20:
        other = np.eye(3)[int(np.argmin(np.abs(back)))]
        up = other - back * np.dot(back, other)
        length = np.linalg.norm(up)
    up = up / length
    out[:3, :3] = np.stack([np.cross(up, back), up, back], axis=1)
    return out


class Animation:
    """The one animation of an exported file: everything in it plays together."""

    def __init__(self, document: Document, times: Sequence[float], name: str = "Shot") -> None:
        self.document = document
        self.times = np.asarray(times, dtype=np.float32)
        self.data: dict = {"name": name, "samplers": [], "channels": []}
        self._samplers: dict[tuple[int, int, str], int] = {}

    def close(self) -> None:
        """Put the animation into the document, if it has a channel."""
        if self.data["channels"]:
            self.document.append("animations", self.data)

    def _channel(self, values: np.ndarray, target: dict, step: bool = False) -> None:
        keep = _kinks(values, step)
        times, output = self.document.add_accessor(self.times[keep], limits=True), self.document.add_accessor(values[keep])
        interpolation = "STEP" if step else "LINEAR"
        samplers = self.data["samplers"]
        index = self._samplers.setdefault((times, output, interpolation), len(samplers))
        if index == len(samplers):
            samplers.append({"input": times, "output": output, "interpolation": interpolation})
        self.data["channels"].append({"sampler": index, "target": target})

    def add_node(self, node: dict, poses: np.ndarray) -> int:
        """Append a node that moves as `poses` say, below another where it is sheared; its index."""
        poses = thickened(poses)
        if not is_sheared(poses):
            index = self.document.append("nodes", node)
            self.node(node, index, poses)
            return index
        upper, lower = split_sheared(poses)
        parent: dict = {"name": f"{node['name']} (sheared)"}
        above = self.document.append("nodes", parent)
        index = self.document.append("nodes", node)
        parent["children"] = [index]
        self.node(parent, above, upper)
        self.node(node, index, lower)
        return index

    def node(self, node: dict, index: int, matrices: np.ndarray) -> None:
        """Give a node its transform at the first sample, and channels for what moves. `matrices` is (samples, 4, 4)."""
        moves, turns, scales = split_trs(np.array(matrices))
        for key, values, rest in (
            ("translation", moves, [0, 0, 0]),
            ("rotation", quaternions(turns), [0, 0, 0, 1]),
            ("scale", scales, [1, 1, 1]),
        ):
            values = values.astype(np.float32)
            if key == "rotation":
                values /= np.linalg.norm(values, axis=1, keepdims=True)
            if np.abs(values[0] - rest).max() > 0:
                node[key] = [float(x) for x in values[0]]
            if varies(values):
                self._channel(values, {"node": index, "path": key})

    def weights(self, index: int, values: np.ndarray) -> None:
        """Morph weights (samples, targets) of node `index`."""
        keep = np.arange(len(values))
        sampler = {
            "input": self.document.add_accessor(self.times[keep], limits=True),
            "output": self.document.add_accessor(values.astype(np.float32).reshape(-1)),
            "interpolation": "LINEAR",
        }
        self.data["samplers"].append(sampler)
        target = {"node": index, "path": "weights"}
        self.data["channels"].append({"sampler": len(self.data["samplers"]) - 1, "target": target})

    def pointer(self, pointer: str, values: np.ndarray, step: bool = False) -> None:
        """A `KHR_animation_pointer` channel, if the values (samples,) or (samples, width) vary."""
        values = np.asarray(values)
        if values.dtype != np.uint8:
            values = values.astype(np.float32)
        if not varies(values):
            return
        self.document.use_extension("KHR_animation_pointer")
        self._channel(values, {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}, step)

    def visibility(self, node: dict, index: int, visible: np.ndarray) -> None:
        """`KHR_node_visibility`: nothing if always seen, static if never, a STEP channel if it changes."""
        if visible.all():
            return
        node.setdefault("extensions", {})["KHR_node_visibility"] = {"visible": bool(visible[0])}
        self.document.use_extension("KHR_node_visibility")
        self.pointer(f"/nodes/{index}/extensions/KHR_node_visibility/visible", visible.astype(np.uint8), step=True)


def varies(values: np.ndarray) -> bool:
    """Whether sampled values are more than one value written in single precision."""
    if len(values) < 2:
        return False
    values = values.astype(np.float64)
    spread = np.abs(values - values[0]).max()
    return bool(spread > _SAME * max(1.0, np.abs(values[0]).max()))


def _kinks(values: np.ndarray, step: bool) -> np.ndarray:
    """Which samples have to be keys: the ends, and those that differ from a neighbour (for STEP: from the one before)."""
    rows = values.reshape(len(values), -1)
    new = np.any(rows[1:] != rows[:-1], axis=1)
    keep = np.ones(len(rows), dtype=bool)
    keep[1:] = new
    if not step:
        keep[:-1] |= new
        keep[-1] = True
    return np.flatnonzero(keep)
