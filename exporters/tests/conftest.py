"""Fixtures: an empty Blender session, the renderer, the Khronos validator."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
sys.path.insert(0, str(Path(__file__).resolve().parent))

_VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs'), path = require('path');
const file = process.argv[1];
validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
  uri: file, maxIssues: 50,
  externalResourceFunction: (uri) => Promise.resolve(
    new Uint8Array(fs.readFileSync(path.resolve(path.dirname(file), decodeURIComponent(uri))))),
}).then((report) => console.log(JSON.stringify(report.issues)));
"""


@pytest.fixture
def blender():
    """`bpy` with an empty scene of two frames, 64 x 36."""
    bpy = pytest.importorskip("bpy", reason="SKIPPED LOUDLY: the bpy package is not installed (pip install bpy)")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.resolution_x, scene.render.resolution_y = 64, 36
    return bpy


@pytest.fixture
def surface(blender):
    """A camera and a square with UV coordinates, colours and the material "Grey"; its Principled node."""
    import blender_scene as b

    b.camera()
    b.light("SUN")
    ob = b.plane("Square", size=2)
    ob.data.uv_layers.new(name="UVMap")
    ob.data.color_attributes.new("Tint", "BYTE_COLOR", "CORNER")
    made, shader = b.material()
    ob.data.materials.append(made)
    return shader


@pytest.fixture
def export(blender, tmp_path):
    """Export the open scene and read it back, validated: export(name=..., **options)."""
    from exporters.blender import job
    from gltf_reader import Gltf

    def run(name: str = "anim.gltf", **options) -> Gltf:
        result = job.export(tmp_path / name, job.Options(**options))
        validate(result.path)
        return Gltf(result.path, result.lost)

    return run


@pytest.fixture
def usd_convert(tmp_path):
    """Convert a stage and read it back, validated: usd_convert(stage or path, name=..., **options)."""
    pytest.importorskip("pxr", reason="SKIPPED LOUDLY: usd-core is not installed (pip install usd-core)")
    from exporters.usd import job
    from gltf_reader import Gltf

    def run(stage, name: str = "anim.gltf", **options) -> Gltf:
        if not isinstance(stage, (str, Path)):
            path = tmp_path / "stage.usda"
            stage.GetRootLayer().Export(str(path))
            stage = path
        result = job.convert(Path(stage), tmp_path / name, job.Options(**options))
        validate(result.path)
        return Gltf(result.path, result.lost)

    return run


def binary() -> str | None:
    """The renderer: BUZZ_CONVERT, or the release build."""
    named = os.environ.get("BUZZ_CONVERT")
    built = ROOT / "target" / "release" / "buzz-convert"
    return named or (str(built) if built.is_file() else None)


@pytest.fixture(scope="session")
def buzz():
    """Run the renderer: buzz("plan", ..., check=True) gives the completed process."""
    program = binary()
    if program is None:
        pytest.skip("SKIPPED LOUDLY: no renderer; build it (cargo build --release) or set BUZZ_CONVERT")

    def run(*arguments, check: bool = True) -> subprocess.CompletedProcess:
        done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False)
        if check:
            assert done.returncode == 0, f"buzz-convert {' '.join(map(str, arguments))}: {done.returncode}\n{done.stderr}"
        return done

    return run


@pytest.fixture(scope="session")
def scenes():
    """The folder of scenes that nobody here made: BUZZ_SCENES, or shared/scenes beside the repository."""
    folder = Path(os.environ.get("BUZZ_SCENES", ROOT.parent / "shared" / "scenes"))
    if not folder.is_dir():
        pytest.skip("SKIPPED LOUDLY: no folder of scenes; set BUZZ_SCENES")
    return folder


def _node_modules() -> Path | None:
    """Where npm put gltf-validator: BUZZ_NODE_MODULES, the repository, or the tests' own cache."""
    places = [os.environ.get("BUZZ_NODE_MODULES"), ROOT / "node_modules", ROOT / "tests" / "node_modules"]
    cache = ROOT / "target" / "gltf-validator"
    for place in [*places, cache / "node_modules"]:
        if place and (Path(place) / "gltf-validator").is_dir():
            return Path(place)
    if shutil.which("npm") is None:
        return None
    cache.mkdir(parents=True, exist_ok=True)
    subprocess.run(["npm", "install", "--silent", "--prefix", str(cache), "gltf-validator"], capture_output=True, check=False, timeout=120)
    found = cache / "node_modules"
    return found if (found / "gltf-validator").is_dir() else None


_MODULES: list[Path | None] = []


def validator_modules() -> Path | None:
    """The validator's folder, looked for once."""
    if not _MODULES:
        _MODULES.append(_node_modules() if shutil.which("node") else None)
        if _MODULES[0] is None:
            print("SKIPPED LOUDLY: gltf-validator (npm) is not there; exports are not validated", file=sys.stderr)
    return _MODULES[0]


def validate(path: Path) -> None:
    """Assert that the Khronos validator finds no error; nothing where it is not installed (test_validator.py says so)."""
    modules = validator_modules()
    if modules is None:
        return
    done = subprocess.run(
        ["node", "-e", _VALIDATE, str(path)], capture_output=True, text=True, env={**os.environ, "NODE_PATH": str(modules)}, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    issues = json.loads(done.stdout)
    assert issues["numErrors"] == 0, [m for m in issues["messages"] if m["severity"] == 0]
