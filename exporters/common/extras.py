"""Writes `scene.extras.buzz` as docs/extras.md describes it, and checks it against the schema where it can."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

from . import VERSION
from .report import ExportError, InputError, Lost

LUMENS_PER_WATT = 683.0
_SCHEMA = Path(__file__).resolve().parents[2] / "docs" / "extras.schema.json"


def rational(fps: float, base: float = 1.0) -> tuple[int, int]:
    """A frame rate as an exact ratio: 24 / 1.001 and 23.976 are 24000 / 1001, not what single precision makes of them."""
    rate = float(fps) / float(base)
    ntsc = Fraction(round(rate * 1.001) * 1000, 1001)
    near = Fraction(rate).limit_denominator(1000)
    # 23.976, 23.98 and 29.97 are how people write the NTSC rates; a whole rate stays whole.
    for candidate, tolerance in ((Fraction(round(rate)), 1e-6), (ntsc, 2e-4), (near, 1e-6)):
        if candidate > 0 and abs(float(candidate) - rate) <= tolerance * rate:
            return candidate.numerator, candidate.denominator
    exact = Fraction(rate).limit_denominator(1_000_000)
    return exact.numerator, exact.denominator


def scene_extras(
    *,
    generator: str,
    application: str,
    file: str,
    fps: tuple[int, int],
    frames: tuple[int, int],
    resolution: tuple[int, int],
    pixel_aspect: float,
    shutter: float | None,
    cuts: list[dict[str, Any]],
    world: dict[str, Any] | None,
    lost: Lost,
) -> dict[str, Any]:
    """The value of `scenes[i].extras.buzz`."""
    extras: dict[str, Any] = {
        "version": 1,
        "generator": f"{generator} {VERSION}",
        "source": {"application": application, "file": Path(file).name},
        "fps": list(fps),
        "frame_start": frames[0],
        "frame_end": frames[1],
        "resolution": list(resolution),
        "pixel_aspect": tidy(pixel_aspect),
    }
    if shutter is not None:
        extras["shutter"] = tidy(shutter)
    if cuts:
        extras["cuts"] = cuts
    if world is not None:
        extras["world"] = world
    if lost.items:
        extras["lost"] = lost.items
    return extras


def simplify_cuts(cuts: list[dict[str, Any]], frame_start: int, frame_end: int) -> list[dict[str, Any]]:
    """Cuts of the range: the first entry stands at `frame_start`, and no entry repeats the camera before it.

    Before the first marker, Blender shows the first marker's camera (`BKE_scene_camera_switch_find`).
    """
    cuts = sorted(cuts, key=lambda c: c["frame"])
    if not cuts:
        return []
    first = next((c for c in reversed(cuts) if c["frame"] <= frame_start), cuts[0])
    kept = [{**first, "frame": frame_start}]
    for cut in cuts:
        if frame_start < cut["frame"] <= frame_end:
            if cut["frame"] == kept[-1]["frame"]:
                kept[-1] = cut
            elif cut["node"] != kept[-1]["node"]:
                kept.append(cut)
    return kept


def check(root: dict[str, Any]) -> None:
    """Refuse numbers that JSON cannot hold, and validate all extras against the schema.

    Blender ships neither the jsonschema package nor the schema; there the tests of this project stand in for that part.
    """
    _refuse_infinite(root, "")
    try:
        import jsonschema
    except ImportError:
        return
    if not _SCHEMA.exists():
        return
    schema = json.loads(_SCHEMA.read_text())
    for name, pointer, value in _described(root):
        validator = jsonschema.Draft202012Validator({**schema, "$ref": f"#/$defs/{name}"})
        for error in validator.iter_errors(value):
            where = "/".join([pointer, *map(str, error.absolute_path)])
            raise ExportError(f"{where}: {error.message}; this is a bug in the exporter, please report it")


def _refuse_infinite(value: Any, pointer: str) -> None:
    if isinstance(value, dict):
        for key, item in value.items():
            _refuse_infinite(item, f"{pointer}/{key}")
    elif isinstance(value, list):
        for i, item in enumerate(value):
            _refuse_infinite(item, f"{pointer}/{i}")
    elif isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"{pointer}: {value} is no number that glTF can hold; look for an endless or broken value in the scene")


def _described(root: dict[str, Any]) -> list[tuple[str, str, Any]]:
    """Every value in a document that the schema has a definition for: definition, JSON pointer, value."""
    found = []
    for i, scene in enumerate(root.get("scenes", [])):
        if "buzz" in scene.get("extras", {}):
            found.append(("scene", f"/scenes/{i}/extras/buzz", scene["extras"]["buzz"]))
    for i, camera in enumerate(root.get("cameras", [])):
        found.append(("camera", f"/cameras/{i}/extras", camera.get("extras", {})))
    lights = root.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    for i, light in enumerate(lights):
        found.append(("light", f"/extensions/KHR_lights_punctual/lights/{i}/extras", light.get("extras", {})))
    for i, node in enumerate(root.get("nodes", [])):
        if "BUZZ_analytic_shape" in node.get("extensions", {}):
            pointer = f"/nodes/{i}/extensions/BUZZ_analytic_shape"
            found.append(("shape_binding", pointer, node["extensions"]["BUZZ_analytic_shape"]))
    return found


def tidy(x: float) -> int | float:
    """A number as a person would write it: single-precision noise rounded off, whole numbers whole."""
    if not math.isfinite(x):
        return 0
    x = float(f"{x:.7g}")
    return int(x) if x == int(x) and abs(x) < 1e9 else x
