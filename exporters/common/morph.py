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
    base = poses[0]
    extent = float(np.ptp(base.reshape(-1, 3), axis=0).max()) or 1.0
    tolerance = TOLERANCE * extent
    if np.abs(poses - base).max() <= tolerance:
        return None
    keys = key_poses(poses, times, tolerance)
    targets: list[int] = []
    which = []
    for k in keys:
        if np.abs(poses[k] - base).max() <= tolerance:
            which.append(-1)
            continue
        same = next((i for i, t in enumerate(targets) if np.abs(poses[t] - poses[k]).max() <= tolerance), None)
        if same is None:
            same = len(targets)
            targets.append(k)
        which.append(same)
    rows = np.zeros((len(keys), len(targets)))
    for row, target in enumerate(which):
        if target >= 0:
            rows[row, target] = 1
    weights = np.stack([np.interp(samples, times[keys], rows[:, t]) for t in range(len(targets))], axis=1)
    return targets, weights


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
