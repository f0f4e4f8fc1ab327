#!/usr/bin/env python3
"""Makes the table of docs/requirements.md: scenes as they are, and without one thing after the other.

    cargo build --release
    python3 scenes/requirements.py OUT [scene ...] [--rounds 3] [--resolution 640x360] [--frames 16]

Every round renders all variants of a scene, one after the other on one thread, so that whatever else the machine does
meets all alike. CPU seconds are of the whole run, reading included, and the least of all rounds.
"""

import argparse
import json
import os
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
HEADER = ["scene", "without", "no longer required", "bytes a pixel", "CPU s", "peak MiB"]

Edit = Callable[[dict], None]


def keep(_: dict) -> None:
    """The scene as it is."""


def no_textures(gltf: dict) -> None:
    """Factors alone."""
    for material in gltf["materials"]:
        for part in (material, material.get("pbrMetallicRoughness", {})):
            for name in [key for key in part if key.endswith("Texture")]:
                del part[name]


def no_mirrors(gltf: dict) -> None:
    """Everything is rough."""
    for material in gltf["materials"]:
        factors = material.setdefault("pbrMetallicRoughness", {})
        factors["roughnessFactor"] = 1.0
        factors.pop("metallicRoughnessTexture", None)


def no_refraction(gltf: dict) -> None:
    """Glass is opaque."""
    for material in gltf["materials"]:
        for name in ("KHR_materials_transmission", "KHR_materials_volume"):
            material.get("extensions", {}).pop(name, None)


def no_alpha(gltf: dict) -> None:
    """Nothing is cut out."""
    for material in gltf["materials"]:
        material.pop("alphaMode", None)


def lights_left(count: int) -> Edit:
    """Only the first lights."""

    def edit(gltf: dict) -> None:
        for node in gltf["nodes"]:
            light = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light", -1)
            if light >= count:
                del node["extensions"]["KHR_lights_punctual"]

    return edit


def no_sizes(gltf: dict) -> None:
    """Lights are points."""
    for light in gltf["extensions"]["KHR_lights_punctual"]["lights"]:
        light.pop("extras", None)


def no_world(gltf: dict) -> None:
    """The world is black."""
    gltf["scenes"][0]["extras"]["buzz"]["world"]["strength"] = 0.0


def no_motion(gltf: dict) -> None:
    """Only cameras move."""
    for animation in gltf["animations"]:
        targets = [channel["target"].get("node") for channel in animation["channels"]]
        of_cameras = [node is not None and "camera" in gltf["nodes"][node] for node in targets]
        animation["channels"] = [c for c, keep in zip(animation["channels"], of_cameras, strict=True) if keep]
    gltf["animations"] = [animation for animation in gltf["animations"] if animation["channels"]]


def seeming_motion(gltf: dict) -> None:
    """Everything hangs on a node that is animated and stays where it is."""
    scene, animation = gltf["scenes"][0], gltf["animations"][0]
    gltf["nodes"].append({"name": "Still", "children": scene["nodes"]})
    still = len(gltf["nodes"]) - 1
    scene["nodes"] = [still]
    times = animation["samplers"][0]["input"]
    # An accessor without a view is zeros.
    gltf["accessors"].append({"componentType": 5126, "count": gltf["accessors"][times]["count"], "type": "VEC3"})
    animation["samplers"].append({"input": times, "output": len(gltf["accessors"]) - 1})
    target = {"node": still, "path": "translation"}
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})


def no_refraction_or_mirrors(gltf: dict) -> None:
    """Glass is opaque, everything is rough."""
    no_refraction(gltf)
    no_mirrors(gltf)


@dataclass
class Variant:
    """A scene without something, or with something more."""

    name: str
    edit: Edit = keep
    options: tuple[str, ...] = ()


AS_IT_IS = Variant("(as it is)")
SOFT = ("--light-samples", "16", "--ambient-samples", "16")
VARIANTS = {
    "courtyard": [
        AS_IT_IS,
        Variant("textures", no_textures),
        Variant("cut-outs", no_alpha),
        Variant("mirrors", no_mirrors),
        Variant("two of three lights", lights_left(1)),
        Variant("lights", lights_left(0)),
        Variant("inferred frames: `-q full`", options=("-q", "full")),
        Variant("*with* `--stereo 0.065`", options=("--stereo", "0.065")),
        Variant("*with* `--light-samples 16`", options=SOFT[:2]),
        Variant("*with* that, without sizes of lights", no_sizes, SOFT[:2]),
        Variant("*with* 16 samples of lights and world", options=SOFT),
        Variant("*with* that, without the world", no_world, SOFT),
        Variant("*with* an animation that moves nothing", seeming_motion),
    ],
    "gallery": [
        AS_IT_IS,
        Variant("refraction", no_refraction),
        Variant("refraction, mirrors", no_refraction_or_mirrors),
    ],
    "stage": [AS_IT_IS, Variant("all motion but the camera's", no_motion)],
}


def write(scene: str, variant: Variant, frames: int, folder: Path) -> Path:
    """A copy of so many frames of a scene, edited."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(HERE / scene, folder)
    file = folder / f"{scene}.gltf"
    gltf = json.loads(file.read_text())
    shot = gltf["scenes"][0]["extras"]["buzz"]
    shot["frame_end"] = shot["frame_start"] + frames - 1
    shot["cuts"] = [cut for cut in shot["cuts"] if cut["frame"] <= shot["frame_end"]]
    variant.edit(gltf)
    file.write_text(json.dumps(gltf))
    return file


def render(binary: Path, gltf: Path, out: Path, options: list[str]) -> tuple[float, dict]:
    """The CPU seconds of a run, and its report."""
    command = [binary, gltf, out, "-j", "1", "--overwrite", "--progress", "none", *options]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{gltf}: buzz-convert ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime, json.loads((out / "report.json").read_text())


def row(scene: str, variant: Variant, runs: list[tuple[float, dict]], required: list[str]) -> list[str]:
    """What a variant took, and what it does not require of what the scene does."""
    report = runs[0][1]
    gone = [name for name in required if name not in report["scene"]["requires"]]
    seconds = min(cpu for cpu, _ in runs)
    peak = min(report["totals"]["peak_bytes"] for _, report in runs) / (1 << 20)
    kept = str(report["scene"]["bytes_per_pixel"])
    return [scene, variant.name, ", ".join(gone), kept, f"{seconds:.2f}", f"{peak:.0f}"]


def main() -> None:
    """Prints the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", nargs="*", default=list(VARIANTS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--resolution", default="640x360")
    parser.add_argument("--frames", type=int, default=16)
    parser.add_argument("--binary", type=Path, default=HERE.parent / "target/release/buzz-convert")
    args = parser.parse_args()
    print("| " + " | ".join(HEADER) + " |\n|" + "---|" * len(HEADER), flush=True)
    for scene in args.scenes:
        variants = VARIANTS[scene]
        files = [
            write(scene, variant, args.frames, args.out / scene / str(number))
            for number, variant in enumerate(variants)
        ]
        runs: list[list[tuple[float, dict]]] = [[] for _ in variants]
        for _ in range(args.rounds):
            for variant, file, of_variant in zip(variants, files, runs, strict=True):
                options = ["-r", args.resolution, *variant.options]
                of_variant.append(render(args.binary, file, args.out / "frames", options))
        required = runs[0][0][1]["scene"]["requires"]
        for variant, of_variant in zip(variants, runs, strict=True):
            print("| " + " | ".join(row(scene, variant, of_variant, required)) + " |", flush=True)


if __name__ == "__main__":
    main()
