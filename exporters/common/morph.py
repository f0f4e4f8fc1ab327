"""Changing shapes as morph targets: which sampled poses have to be kept, and the weights that bring back all others.

glTF blends linearly, so a pose is left out where a straight line between its neighbours comes within `TOLERANCE` of the
mesh's size. Poses that come again (a walk cycle) share one target.
"""

from __future__ import annotations

import numpy as np

TOLERANCE = 2e-5
# Longest run of poses tested against one straight line; it bounds the work, which grows with its square.
_LONGEST = 32


def choose_targets(poses: np.ndarray, times: np.ndarray, samples: np.ndarray) -> tuple[list[int], np.ndarray] | None:
    """Of poses (n, values) in order of `times`: numbers of those that become targets, and weights (samples, targets).

    The first pose is the mesh itself. None if nothing moves.
    """
    if poses.shape[1] == 0:
        return None
    base = poses[0]
    extent = float(np.ptp(base.reshape(-1, 3), axis=0).max()) or 1.0
    tolerance = TOLERANCE * extent
    if np.abs(poses - base).max() <= tolerance:
        return None
    keys = key_poses(poses, times, tolerance)
    # The largest movements first: a pose on the straight line to a target that is already there needs none of its own.
    targets: list[int] = []
    found: dict[int, tuple[int, float]] = {}
    for k in sorted(keys, key=lambda k: -float(np.abs(poses[k] - base).max())):
        move = poses[k].astype(np.float64) - base
        if np.abs(move).max() <= tolerance:
            continue
        match = next((m for m in (_share(move, poses[t] - base, i, tolerance) for i, t in enumerate(targets)) if m), None)
        if match is None:
            targets.append(k)
            match = (len(targets) - 1, 1.0)
        found[k] = match
    rows = np.zeros((len(keys), len(targets)))
    for row, k in enumerate(keys):
        if k in found:
            rows[row, found[k][0]] = found[k][1]
    weights = np.stack([np.interp(samples, times[keys], rows[:, t]) for t in range(len(targets))], axis=1)
    return targets, weights


def _share(move: np.ndarray, target: np.ndarray, number: int, tolerance: float) -> tuple[int, float] | None:
    """The share of a target that makes a movement, if it does."""
    target = target.astype(np.float64)
    share = float(np.dot(move, target) / np.dot(target, target))
    return (number, share) if np.abs(move - share * target).max() <= tolerance else None


def key_poses(poses: np.ndarray, times: np.ndarray, tolerance: float) -> list[int]:
    """Numbers of poses (n, values) such that straight lines between them stay within the tolerance of all others."""
    keys = [0]
    while keys[-1] < len(poses) - 1:
        start = keys[-1]
        end = start + 1
        while end + 1 < len(poses) and end - start < _LONGEST and _straight(poses, times, start, end + 1, tolerance):
            end += 1
        keys.append(end)
    return keys


def _straight(poses: np.ndarray, times: np.ndarray, start: int, end: int, tolerance: float) -> bool:
    for i in range(start + 1, end):
        t = (times[i] - times[start]) / (times[end] - times[start])
        if np.abs(poses[start] + (poses[end] - poses[start]) * t - poses[i]).max() > tolerance:
            return False
    return True
