"""Reads EXR files with OpenEXR and OpenImageIO and compares them with what was meant to be written.

    read_exr.py MANIFEST.json

The manifest is a list of {file, data, display, channels: [{name, half, raw}], attributes: {name: value}}; `raw` names a
file of little-endian floats. Exits with 77 if a module is missing.
"""

import json
import sys
from fractions import Fraction
from pathlib import Path

try:
    import numpy as np
    import OpenEXR
    import OpenImageIO as oiio
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)


def plain(value):
    """An attribute's value as JSON would hold it."""
    if isinstance(value, Fraction):
        return [value.numerator, value.denominator]
    if isinstance(value, np.ndarray):
        return [float(x) for x in value.flatten()]
    if isinstance(value, tuple):
        return [plain(x) for x in value]
    if hasattr(value, "n") and hasattr(value, "d"):
        return [value.n, value.d]
    if type(value).__name__ == "TimeCode":
        return [value.hours, value.minutes, value.seconds, value.frame]
    return value


def same(have, want):
    if isinstance(want, list):
        return len(have) == len(want) and all(same(h, w) for h, w in zip(have, want))
    if isinstance(want, float):
        return abs(have - want) <= 1e-5 * max(1.0, abs(want))
    return have == want


def check_openexr(case, expected):
    file = OpenEXR.File(case["file"], separate_channels=True)
    assert len(file.parts) == 1, "one part"
    header, channels = file.header(), file.channels()
    assert sorted(channels) == sorted(expected), (sorted(channels), sorted(expected))
    for name, values in expected.items():
        pixels = channels[name].pixels
        assert pixels.dtype == values.dtype, (name, pixels.dtype)
        assert np.array_equal(pixels, values), name
    for attribute, want in case["attributes"].items():
        assert attribute in header, f"{attribute} is missing from {sorted(header)}"
        have = plain(header[attribute])
        assert same(have, want), f"{attribute}: {have} instead of {want}"
    assert "capDate" not in header
    windows = [header["dataWindow"], header["displayWindow"]]
    for window, (x, y, width, height) in zip(windows, [case["data"], case["display"]]):
        low, high = window
        assert [int(v) for v in (*low, *high)] == [x, y, x + width - 1, y + height - 1], window


def check_oiio(case, expected):
    image = oiio.ImageInput.open(case["file"])
    assert image, oiio.geterror()
    spec = image.spec()
    names = list(spec.channelnames)
    formats = list(spec.channelformats) or [spec.format] * spec.nchannels
    assert [spec.x, spec.y, spec.width, spec.height] == case["data"]
    assert names[:4] == ["R", "G", "B", "A"], names
    pixels = image.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
    image.close()
    for name, values in expected.items():
        index = names.index(name)
        half = formats[index] == oiio.TypeDesc("half")
        assert half == (values.dtype == np.float16), (name, formats[index])
        assert np.array_equal(pixels[..., index], values.astype(np.float32)), name


def main():
    cases = json.loads(Path(sys.argv[1]).read_text())
    for case in cases:
        width, height = case["data"][2:]
        expected = {}
        for channel in case["channels"]:
            values = np.fromfile(channel["raw"], "<f4").reshape(height, width)
            expected[channel["name"]] = values.astype(np.float16 if channel["half"] else np.float32)
        try:
            check_openexr(case, expected)
            check_oiio(case, expected)
        except AssertionError as wrong:
            print(f"{case['file']}: {wrong}")
            sys.exit(1)
    print(f"{len(cases)} files read")


main()
