"""Rebuilds the scenes: `python3 scenes/build/make.py [name ...]`, all of them without a name."""

import importlib
import sys
from pathlib import Path

#: Each name is a folder of `scenes/` and, with underscores, a module beside this file.
SCENES = ("courtyard", "gallery", "buzz-city", "stage")


def build(name):
    """The scene of that name."""
    return importlib.import_module(name.replace("-", "_")).build()


def main():
    for name in sys.argv[1:] or SCENES:
        scene = build(name)
        scene.write(Path(__file__).resolve().parent.parent / name)
        size = sum(len(data) for data in scene.files().values())
        print(f"{name}: {scene.triangle_count()} triangles, {scene.frames} frames, {size} bytes")


if __name__ == "__main__":
    main()
