"""Convert a USD stage (.usd, .usda, .usdc, .usdz) to glTF for buzz-convert.

    python exporters/usd/usd_to_gltf.py stage.usda out/anim.gltf [--camera /path] [--variant set=value] ...

Exit codes: 0 done, 1 failed, 2 usage, 3 bad input, 4 output not writable.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path


def _import():
    here = Path(__file__).resolve()
    sys.path[:] = [p for p in sys.path if Path(p or ".").resolve() != here.parent]
    sys.path.insert(0, str(here.parents[2]))
    try:
        job = importlib.import_module("exporters.usd.job")
    except ImportError as error:
        print(f"error: {error}; install the packages usd-core, numpy and pillow", file=sys.stderr)
        raise SystemExit(1) from None
    return job, importlib.import_module("exporters.common.report")


def _variant(text: str) -> tuple[str, str, str]:
    left, found, choice = text.partition("=")
    path, _, name = left.rpartition(":")
    if not found or not name or not choice:
        raise argparse.ArgumentTypeError(f"{text!r} is not SET=VALUE or /prim:SET=VALUE")
    return path, name, choice


def _pair(separator: str):
    def pair(text: str) -> tuple[int, int]:
        sign = -1 if text.startswith("-") else 1
        first, found, second = text.lstrip("-").partition(separator)
        try:
            if not found:
                raise ValueError
            return sign * int(first), int(second)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not two whole numbers with {separator!r} between") from None

    return pair


def _resolution(text: str) -> tuple[int, int]:
    size = _pair("x")(text)
    if min(size) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} has no pixels: width and height must be 1 or more")
    return size


def main(argv: list[str]) -> int:
    """Parse and convert; the exit code."""
    parser = argparse.ArgumentParser(prog="usd_to_gltf.py", description="Convert a USD stage to glTF with nothing lost.")
    parser.add_argument("stage", type=Path, help=".usd, .usda, .usdc or .usdz (it is not changed)")
    parser.add_argument("output", type=Path, help="where to write: .gltf or .glb")
    parser.add_argument("--camera", help="prim path or name of the camera (render settings', else the first animated one)")
    parser.add_argument("--variant", type=_variant, action="append", default=[], metavar="[/prim:]SET=VALUE", help="choose a variant; repeatable")
    parser.add_argument("--frames", type=_pair("-"), help="FIRST-LAST frames (the stage's)")
    parser.add_argument("--resolution", type=_resolution, help="WIDTHxHEIGHT (the render settings')")
    parser.add_argument("--subdivision", type=int, default=2, help="levels for subdivision meshes, 0: the cage (2)")
    parser.add_argument("--no-camera-light", action="store_true", help="leave a stage without lights dark")
    arguments = parser.parse_args(argv)
    job, report = _import()
    options = job.Options(
        frames=arguments.frames,
        resolution=arguments.resolution,
        camera=arguments.camera,
        variants=arguments.variant,
        levels=max(arguments.subdivision, 0),
        camera_light=not arguments.no_camera_light,
        progress=lambda line: print(f"convert: {line}", flush=True),
    )
    try:
        result = job.convert(arguments.stage, arguments.output, options)
    except report.ExportError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.code
    result.lost.show()
    print(f"wrote {result.path}", flush=True)
    return 0


if __name__ == "__main__":
    try:
        code = main(sys.argv[1:])
    except Exception as error:
        if os.environ.get("BUZZ_TRACEBACK"):
            raise
        print(f"error: {type(error).__name__}: {error}; set BUZZ_TRACEBACK=1 and report this", file=sys.stderr)
        code = 1
    sys.exit(code)
