"""Export a Blender file's shot to glTF, with or without Blender's window.

    blender -b shot.blend -P exporters/blender/export.py -- out/anim.gltf [options]
    python exporters/blender/export.py shot.blend out/anim.gltf [options]       (with the bpy package from PyPI)

Exit codes: 0 done, 1 failed, 2 usage, 3 bad input, 4 output not writable.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path


def _package():
    """Import this script's package under whatever name its folder has (a source tree or an installed extension)."""
    here = Path(__file__).resolve()
    sys.path[:] = [p for p in sys.path if Path(p or ".").resolve() != here.parent]
    sys.path.insert(0, str(here.parents[2]))
    return importlib.import_module(f"{here.parents[1].name}.{here.parent.name}.job"), importlib.import_module(f"{here.parents[1].name}.common.report")


def _arguments(inside_blender: bool, argv: list[str]) -> argparse.Namespace:
    program = "export.py"
    if inside_blender:
        argv = argv[argv.index("--") + 1 :] if "--" in argv else []
        program = "blender -b FILE.blend -P export.py --"
    parser = argparse.ArgumentParser(prog=program, description="Export a Blender file's shot to glTF with nothing lost.")
    if not inside_blender:
        parser.add_argument("blend", type=Path, help="the .blend file (it is not changed)")
        parser.add_argument("--scripts", action="store_true", help="run the Python of its drivers and texts: for files that you trust")
    parser.add_argument("output", type=Path, help="where to write: .gltf or .glb")
    parser.add_argument("--frames", type=_pair("-"), help="FIRST-LAST (the scene's)")
    parser.add_argument("--resolution", type=_size, help="WIDTHxHEIGHT (the scene's)")
    parser.add_argument("--camera", help="one camera for the whole shot (the markers', else the scene's)")
    parser.add_argument("--scene", help="name of the scene (the one last open)")
    parser.add_argument("--bake", type=_pixels, default=1024, help="pixels of baked procedural textures, 0: do not bake (1024)")
    return parser.parse_args(argv)


def _pair(separator: str):
    def parse(text: str) -> tuple[int, int]:
        # A minus before the first number is a sign: "-10--1" is -10 to -1.
        sign = -1 if text.startswith("-") else 1
        first, found, second = text.lstrip("-").partition(separator)
        try:
            if not found or (sign < 0 and separator != "-"):
                raise ValueError
            return sign * int(first), int(second)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not two whole numbers with {separator!r} between") from None

    parse.__name__ = "pair"
    return parse


def _pixels(text: str) -> int:
    if not text.isdecimal() or int(text) > 16384:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of pixels from 0 to 16384")
    return int(text)


def _size(text: str) -> tuple[int, int]:
    size = _pair("x")(text)
    if min(size) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} has no pixels; width and height are at least 1")
    return size


def main() -> int:
    """Parse, open, export; the exit code."""
    import bpy

    inside = bool(bpy.app.binary_path)
    arguments = _arguments(inside, sys.argv if inside else sys.argv[1:])
    job, report = _package()
    try:
        if not inside:
            if not arguments.blend.is_file():
                raise report.InputError(f"{arguments.blend}: no such file")
            try:
                bpy.ops.wm.open_mainfile(filepath=str(arguments.blend.resolve()), load_ui=False, use_scripts=arguments.scripts)
            except RuntimeError as error:
                detail = " ".join(str(error).split())
                raise report.InputError(f"{arguments.blend}: not a Blender file that {bpy.app.version_string} opens ({detail})") from None
        options = job.Options(
            frames=arguments.frames,
            resolution=arguments.resolution,
            camera=arguments.camera,
            scene=arguments.scene,
            bake=arguments.bake,
            progress=lambda line: print(f"export: {line}", flush=True),
        )
        result = job.export(arguments.output, options)
    except report.ExportError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.code
    result.lost.show()
    print(f"wrote {result.path}", flush=True)
    return 0


if __name__ == "__main__":
    try:
        code = main()
    except SystemExit as exit_:
        code = exit_.code if isinstance(exit_.code, int) else 2
    except Exception as error:
        if os.environ.get("BUZZ_TRACEBACK"):
            raise
        print(f"error: {type(error).__name__}: {error}; set BUZZ_TRACEBACK=1 and report this", file=sys.stderr)
        code = 1
    sys.stdout.flush()
    sys.stderr.flush()
    import bpy

    # Blender ignores sys.exit() codes of scripts unless told so, and its shutdown can crash in background mode.
    # With its window open, Blender stays.
    if bpy.app.background:
        os._exit(code)
