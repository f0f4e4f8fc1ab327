"""Camera paths: points on smooth curves, and the orientations that look along them."""

import numpy as np

from mesh import rotation_x, rotation_y, rotation_z, unit


def spline(keys, frames):
    """A natural cubic spline through `keys` {frame: value}, read at `frames`.

    Its second derivative is continuous: a camera that follows it never jerks.
    """
    at = np.array(sorted(keys), float)
    values = np.array([keys[k] for k in sorted(keys)], float).reshape(len(at), -1)
    bend = _second_derivatives(at, values)
    frames = np.asarray(frames, float)
    i = np.clip(np.searchsorted(at, frames, side="right") - 1, 0, len(at) - 2)
    h = (at[i + 1] - at[i])[:, None]
    a = (at[i + 1] - frames)[:, None] / h
    b = 1 - a
    curve = (a**3 - a) * bend[i] + (b**3 - b) * bend[i + 1]
    return a * values[i] + b * values[i + 1] + curve * h**2 / 6


def _second_derivatives(at, values):
    count = len(at)
    step = np.diff(at)
    matrix, right = np.eye(count), np.zeros_like(values)
    for i in range(1, count - 1):
        matrix[i, i - 1 : i + 2] = step[i - 1], 2 * (step[i - 1] + step[i]), step[i]
        right[i] = 6 * ((values[i + 1] - values[i]) / step[i] - (values[i] - values[i - 1]) / step[i - 1])
    return np.linalg.solve(matrix, right)


def look_along(heading, pitch=0.0, roll=0.0):
    """Rotation matrices (world from camera) from angles in degrees.

    Heading 0 looks along -z and grows to the right, pitch looks up, roll tips the camera to its left.
    """
    angles = np.broadcast_arrays(heading, pitch, roll)
    return np.array([rotation_y(-h) @ rotation_x(p) @ rotation_z(r) for h, p, r in zip(*angles, strict=True)])


def look_at(eyes, targets):
    """Rotation matrices (world from camera) that look from eyes to targets, the horizon level."""
    x, y, z = (np.asarray(targets, float) - eyes).T
    return look_along(np.degrees(np.arctan2(x, -z)), np.degrees(np.arctan2(y, np.hypot(x, z))))


def quaternions(rotations):
    """Unit quaternions (x, y, z, w) of rotation matrices, each on the same side as the one before."""
    result = np.array([_quaternion(m) for m in rotations])
    for i in range(1, len(result)):
        if result[i] @ result[i - 1] < 0:
            result[i] = -result[i]
    return result


def _quaternion(m):
    # Shepperd's method: the largest of the four squares is far from zero, so nothing is lost by dividing.
    squares = [m[0, 0], m[1, 1], m[2, 2], m[0, 0] + m[1, 1] + m[2, 2]]
    largest = int(np.argmax(squares))
    if largest == 3:
        q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + squares[3]])
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q = np.empty(4)
        q[i] = 1 + m[i, i] - m[j, j] - m[k, k]
        q[j], q[k], q[3] = m[i, j] + m[j, i], m[i, k] + m[k, i], m[k, j] - m[j, k]
    return unit(q)
