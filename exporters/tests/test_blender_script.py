"""The script as a user runs it: arguments, exit codes, one line for each error, and a file that stays as it was."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "blender" / "export.py"


def run(*arguments):
    """Run export.py with this Python."""
    return subprocess.run([sys.executable, str(SCRIPT), *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


@pytest.fixture
def blend(blender, tmp_path):
    """A saved file with an animated camera and a procedural material."""
    import blender_scene as b

    ob = b.camera()
    b.key(ob, "location", {1: (0, -8, 2), 2: (1, -8, 2)})
    b.cube().data.materials.append(b.material()[0])
    path = tmp_path / "Shot with spaces ä.blend"
    blender.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def test_export_leaves_the_file_alone(blend, tmp_path):
    before = hashlib.sha256(blend.read_bytes()).hexdigest()
    done = run(blend, tmp_path / "out" / "anim.gltf", "--frames", "1-2", "--resolution", "32x18")
    assert done.returncode == 0, done.stderr
    assert hashlib.sha256(blend.read_bytes()).hexdigest() == before
    root = json.loads((tmp_path / "out" / "anim.gltf").read_text())
    assert root["scenes"][0]["extras"]["buzz"]["resolution"] == [32, 18]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["anim.bin", "anim.gltf"]


def test_glb_is_one_file(blend, tmp_path):
    assert run(blend, tmp_path / "glb" / "anim.glb").returncode == 0
    assert [p.name for p in (tmp_path / "glb").iterdir()] == ["anim.glb"]


def test_as_blender_runs_it(blend, tmp_path):
    """`blender -b file -P export.py -- out.gltf`: the file is open, and only what follows `--` is ours."""
    target = tmp_path / "inside" / "anim.gltf"
    code = f"""
import bpy, runpy, sys
bpy.ops.wm.open_mainfile(filepath={str(blend)!r})
bpy.app.binary_path = "/usr/bin/blender"
sys.argv = ["blender", "-b", {str(blend)!r}, "-P", {str(SCRIPT)!r}, "--", {str(target)!r}, "--resolution", "10x6"]
runpy.run_path({str(SCRIPT)!r}, run_name="__main__")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(target.read_text())["scenes"][0]["extras"]["buzz"]["resolution"] == [10, 6]


@pytest.mark.parametrize(
    ("make", "arguments", "code", "words"),
    [
        (None, ["gone.blend", "o.gltf"], 3, "no such file"),
        (b"this is not a Blender file", ["bad.blend", "o.gltf"], 3, "not a Blender file"),
        (b"", ["bad.blend", "o.gltf"], 3, "not a Blender file"),
        ("good", ["good", "o.obj"], 4, ".gltf or .glb"),
        ("good", ["good", "o.gltf", "--camera", "Nobody"], 3, "it has Camera"),
        ("good", ["good", "o.gltf", "--scene", "Nothing"], 3, "the file has Scene"),
        ("good", ["good", "o.gltf", "--frames", "5-1"], 3, "before the first"),
        ("good", ["good", "o.gltf", "--frames", "five"], 2, "two whole numbers"),
        ("good", ["good", "o.gltf", "--resolution", "0x0"], 2, "at least 1"),
        ("good", ["good", "o.gltf", "--resolution", "64x0"], 2, "at least 1"),
        ("good", ["good", "o.gltf", "--resolution", "10x-5"], 2, "at least 1"),
        ("good", ["good", "o.gltf", "--bake=-5"], 2, "from 0 to 16384"),
        ("good", ["good", "bad.blend/o.gltf"], 4, "cannot be written"),
    ],
)
def test_bad_input(blend, tmp_path, make, arguments, code, words):
    (tmp_path / "bad.blend").write_bytes(make if isinstance(make, bytes) else b"x")
    arguments = [blend if a == "good" else tmp_path / a if "." in a else a for a in arguments]
    done = run(*arguments)
    assert done.returncode == code, done.stderr
    assert words in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    if code != 2:
        assert len([line for line in done.stderr.splitlines() if line.startswith("error:")]) == 1
