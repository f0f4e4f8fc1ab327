"""Drawn things over the shot: where each is, whether it is seen, and with which geometry."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..common import motion
from .shapes import Geometry

_FAR = 1e5


@dataclass
class Track:
    """One drawn thing, sampled."""

    name: str
    poses: list[np.ndarray] = field(default_factory=list)
    visible: list[bool] = field(default_factory=list)
    shapes: list[int | None] = field(default_factory=list)

    def add(self, world: np.ndarray, visible: bool, shape: int | None) -> None:
        """Take in a sample; equal poses are kept once."""
        same = self.poses and np.array_equal(self.poses[-1], world)
        self.poses.append(self.poses[-1] if same else world)
        self.visible.append(visible)
        self.shapes.append(shape)

    def write(self, animation: motion.Animation, items: list[Geometry]) -> None:
        """Add a node for each geometry that is seen, with its channels."""
        poses = distinct(self.poses)
        for number in dict.fromkeys(n for n in self.shapes if n is not None):
            item = items[number]
            shown = np.array([v and n == number for v, n in zip(self.visible, self.shapes, strict=True)])
            if not shown.any() or item.mesh is None:
                continue
            node: dict[str, Any] = {"name": self.name, "mesh": item.mesh}
            index = animation.add_node(node, poses)
            if item.binding is not None:
                node.setdefault("extensions", {})["BUZZ_analytic_shape"] = item.binding
            animation.visibility(node, index, shown)
            if item.weights is not None:
                animation.weights(index, item.weights)


def distinct(poses: list[np.ndarray]) -> np.ndarray:
    """The poses of a track (n, 4, 4); a single one where it does not move."""
    moves = any(p is not poses[0] for p in poses)
    return np.array(poses if moves else poses[:1])


def stands_still(poses: np.ndarray) -> bool:
    """Whether places so far out move by less than single precision, which glTF has, can tell apart there."""
    places = poses[:, :3, 3]
    steps = np.abs(np.diff(places, axis=0)).max(axis=0, initial=0)
    far = np.abs(places).max(axis=0)
    # Far less than that is the rounding of double precision, no movement.
    rounding = np.spacing(far.astype(np.float32))
    return bool(((far > _FAR) & (steps < rounding) & (steps > rounding * 1e-6)).any())
