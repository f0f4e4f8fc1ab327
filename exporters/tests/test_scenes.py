"""Every stage and every .blend that nobody here made: exported, validated, rendered; each loss in a line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import validate

EXPORTERS = Path(__file__).resolve().parents[1]
BLENDS = [
    "00_extras_scene", "00_parented_to_bone_and_animated", "00_slide_negative_frames", "01_alpha_blend", "01_alpha_mask", "01_cs_morph",
    "01_multiple_collection_instances", "AreaLight_269", "TorusLightsCams_250", "cornell", "living_room", "room",
]  # fmt: skip
STAGES = [
    "full_assets/McUsd/McUsd.usda",
    "full_assets/McUsd/McUsd_10cm.usda",
    "full_assets/StandardShaderBall/standard_shader_ball_scene.usda",
    "full_assets/SubdivisionSurfaces/Creases_SpinningPyramids.usda",
    "full_assets/Vehicles/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda",
    "test_assets/NormalsTextureBiasAndScale/NormalsTextureBiasAndScale.usda",
    "test_assets/NormalsTextureBiasAndScale/NormalsTextureBiasAndScale.usdz",
    "test_assets/AlphaBlendSortTest/AlphaBlendSortTest.usda",
    "test_assets/TextureCoordinateTest/TextureCoordinateTest.usda",
    "test_assets/RoughnessTest/RoughnessTest.usdz",
    "test_assets/USDZ/AnimatedCube/AnimatedCube.usdz",
]


def exported(script: str, source: Path, target: Path, *options: str) -> dict:
    """Run an exporter as a user does; the scene's extras. Every loss is a line, every line has three parts."""
    if not source.is_file():
        pytest.skip(f"SKIPPED LOUDLY: {source} is not there")
    command = [sys.executable, str(EXPORTERS / script), str(source), str(target), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stderr
    validate(target)
    buzz = json.loads(target.read_text())["scenes"][0]["extras"]["buzz"]
    lines = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert len(lines) == len(buzz.get("lost", []))
    for item in buzz.get("lost", []):
        assert all(item[key] for key in ("object", "feature", "action"))
    return buzz


def rendered(buzz, target: Path, extras: dict, out: Path) -> None:
    """Render two frames small."""
    first = extras["frame_start"]
    if extras.get("cuts"):
        last = min(first + 1, extras["frame_end"])
        arguments = ["-f", f"{first}-{last}"]
    else:
        arguments = ["--turntable", "2"]
    buzz(target, out, "-r", "96x54", *arguments)
    assert list(out.glob("*.exr"))


@pytest.mark.parametrize("name", BLENDS)
def test_blend(scenes, buzz, tmp_path, name):
    target = tmp_path / f"{name}.gltf"
    extras = exported("blender/export.py", scenes / "blend" / f"{name}.blend", target, "--bake", "64")
    rendered(buzz, target, extras, tmp_path / "out")


@pytest.mark.parametrize("name", STAGES)
def test_stage(scenes, buzz, tmp_path, name):
    target = tmp_path / "stage.gltf"
    extras = exported("usd/usd_to_gltf.py", scenes / "usd" / name, target, "--subdivision", "1")
    rendered(buzz, target, extras, tmp_path / "out")


def test_vehicle_variants(scenes, tmp_path):
    """Another vehicle is another number of triangles."""
    source = scenes / "usd" / STAGES[4]
    if not source.is_file():
        pytest.skip(f"SKIPPED LOUDLY: {source} is not there")
    sizes = []
    for choice in ("ambulance", "tractor"):
        target = tmp_path / f"{choice}.gltf"
        exported("usd/usd_to_gltf.py", source, target, "--subdivision", "0", "--variant", f"wheels={choice}")
        sizes.append((tmp_path / f"{choice}.bin").stat().st_size)
    assert sizes[0] != sizes[1]
