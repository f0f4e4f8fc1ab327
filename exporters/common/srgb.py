"""The sRGB transfer function (IEC 61966-2-1), on arrays."""

from __future__ import annotations

import numpy as np


def encoded(linear: np.ndarray) -> np.ndarray:
    """Linear values as sRGB codes, 0-1; negative ones as on the straight part."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def decoded(coded: np.ndarray) -> np.ndarray:
    """sRGB codes, 0-1, as linear values; negative ones as on the straight part."""
    return np.where(coded <= 0.04045, coded / 12.92, ((np.maximum(coded, 0) + 0.055) / 1.055) ** 2.4)
