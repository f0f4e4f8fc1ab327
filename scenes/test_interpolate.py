"""The baseline is fair: frames come out in their places, and better than the nearest kept one."""

import numpy as np
import pytest

from scenes import interpolate


def test_interpolated_frames_are_in_their_places() -> None:
    """A pattern that moves by two pixels a frame: kept frames come back, the others are near what they stand for."""
    pytest.importorskip("imageio_ffmpeg")
    y, x = np.mgrid[0:90, 0:160]
    dots = np.random.default_rng(1).random((8, 3))

    def picture(frame: int) -> np.ndarray:
        waves = [np.sin((x - 2 * frame) * (0.08 + 0.2 * a) + y * 0.3 * b + 6 * c) for a, b, c in dots]
        return np.repeat(((np.sum(waves, axis=0) / 16) + 0.5)[..., None], 3, axis=2).clip(0, 1)

    pictures = [picture(frame) for frame in range(18)]
    made, seconds = interpolate.interpolate(pictures)
    assert len(made) == 17 and seconds > 0
    for i, frame in enumerate(made):
        error = interpolate.decibels(frame, pictures[i])
        if i % interpolate.KEPT == 0:
            assert error > 40
        else:
            nearest = pictures[round(i / interpolate.KEPT) * interpolate.KEPT]
            assert error > interpolate.decibels(nearest, pictures[i]) + 3, i


def test_ranges_and_decibels() -> None:
    """As the command line has them."""
    assert interpolate.ranges("1-3,7-7") == {1, 2, 3, 7}
    assert interpolate.decibels(np.zeros(4), np.full(4, 0.1)) == pytest.approx(20)
