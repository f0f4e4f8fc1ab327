"""Build the extension's zip and check it with Blender's own validator.

    python exporters/blender/build.py buzz_gltf.zip

The validator ships with Blender and with the bpy package, and runs without either being started.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[1]
_INIT = '''"""Buzz glTF: camera moves to glTF with nothing lost."""

from .blender import register, unregister

__all__ = ["register", "unregister"]
'''


def find_tool() -> Path | None:
    """Blender's extension tool, in the bpy package or beside a `blender` on the search path."""
    spec = importlib.util.find_spec("bpy")
    places = [Path(spec.origin).parent] if spec and spec.origin else []
    blender = shutil.which("blender")
    if blender:
        places.append(Path(blender).resolve().parent)
    for place in places:
        found = sorted(place.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
        if found:
            return found[-1]
    return None


def build(target: Path) -> int:
    """Stage, build, validate; the exit code."""
    tool = find_tool()
    if tool is None:
        print("error: Blender's extension tool is not found; install the bpy package or put blender on the search path", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        stage = Path(folder) / "buzz_gltf"
        ignore = shutil.ignore_patterns("__pycache__", "build.py", "blender_manifest.toml")
        shutil.copytree(_ROOT / "common", stage / "common", ignore=ignore)
        shutil.copytree(_ROOT / "blender", stage / "blender", ignore=ignore)
        shutil.copy(_ROOT / "blender" / "blender_manifest.toml", stage)
        (stage / "__init__.py").write_text(_INIT)
        target.parent.mkdir(parents=True, exist_ok=True)
        for arguments in (["build", "--source-dir", str(stage), "--output-filepath", str(target.resolve())], ["validate", str(target.resolve())]):
            done = subprocess.run([sys.executable, str(tool), *arguments], capture_output=True, text=True, check=False)
            if done.returncode != 0:
                print(f"error: {arguments[0]}: {(done.stdout + done.stderr).strip()}", file=sys.stderr)
                return 1
    print(f"wrote {target}")
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print("usage: build.py OUTPUT.zip", file=sys.stderr)
        sys.exit(2)
    sys.exit(build(Path(sys.argv[1])))
