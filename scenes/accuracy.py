#!/usr/bin/env python3
"""Measures what inferred frames save and how far they are from traced ones: the figures of docs/algorithm.md.

    cargo build --release
    .venv/bin/python scenes/accuracy.py OUT [walks paper moving soft stereo antialias ...] [--resolution 1280x720]

Whole ranges against `-q full`: rays to the eye and to lights saved, key frames included, PSNR of inferred frames and
their worst, pixels off by more than 5 % and, of the four walks, what is hidden of the reused. Where tracing takes long
(`soft`, `stereo`, `antialias`) every eighth frame is traced. `soft` says besides how many times as fast inference is,
wall against wall without the writing. All of it takes an hour on two cores; scenes that are not there are left out.
"""

import argparse
import json
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from statistics import mean

from trade import ROOT, SCENES, WALKS, run, table

BINARY = ROOT / "target/release/buzz-convert"
STILL = ("breakfast_dolly", "gas_station_orbit_cut_whip", "sponza_walk_cut", "zdm2_fastpan")
# Such that the median of all depths has a disparity of 20 pixels.
INTEROCULAR = dict(zip(STILL, (0.0573, 0.1590, 0.1369, 0.2235), strict=True))
EYE, LIGHTS, ALL = ("primary", "visibility"), ("shadow", "ambient"), ("primary", "visibility", "shadow", "ambient")
SOFT = ["--light-samples", "16", "--ambient-samples", "16"]
TITLES = ["scene", "rays to the eye saved", "to lights", "both", "PSNR mean", "worst frame", "over 5 %", "remarks"]

Frames = dict[tuple[int, str | None], dict]


class Measured:
    """A sequence that has been rendered: its frames by number and eye, as the report has them."""

    def __init__(self, scene: Path, out: Path, *options: str) -> None:
        shutil.rmtree(out, ignore_errors=True)
        run(BINARY, scene, out, "--progress", "none", *options)
        self.out = out
        self.report = json.loads(next(out.glob("report*.json")).read_text())
        self.frames: Frames = {(f["frame"], f.get("eye")): f for f in self.report["frames"]}

    def rays(self, kinds: tuple[str, ...], eye: str | None = None, span: range | None = None) -> float:
        """Rays a frame, of one eye and of these frames."""
        counted = [f for (n, of), f in self.frames.items() if of == eye and (span is None or n in span)]
        return mean(sum(f["rays"][kind] for kind in kinds) for f in counted)

    def seconds(self) -> float:
        """Seconds a frame, writing left out."""
        return mean(sum(f["seconds"][stage] for stage in ("infer", "trace", "enhance")) for f in self.frames.values())

    def errors(self, reference: "Measured", eye: str | None = None) -> list[dict]:
        """Of the frames that were inferred and are in the reference, those that are not the same."""
        compared = json.loads(run(BINARY, "compare", self.out, reference.out, "--format", "json"))["frames"]
        of_eye = [e for e in compared if eye is None or f".{eye}." in e["file"]]
        return [e for e in of_eye if self.frames[e["frame"], eye].get("from") is not None]

    def hidden(self) -> str:
        """What is hidden of the reused."""
        totals = self.report["totals"]
        reused = sum(totals["pixels"][name] for name in ("good", "overlapped", "filled"))
        return f"{totals['hidden']} of {reused} hidden ({100 * totals['hidden'] / reused:.4f} %)"


def row(title: str, inferred: Measured, full: Measured, remarks: str = "", eye: str | None = None) -> list[str]:
    """A row of the table."""
    saved = [1 - inferred.rays(kinds, eye) / full.rays(kinds, eye) for kinds in (EYE, LIGHTS, ALL)]
    errors = inferred.errors(full, eye)
    decibels = [e["psnr_db"] for e in errors if e["psnr_db"] is not None]
    psnr = [f"{mean(decibels):.1f} dB", f"{min(decibels):.1f} dB"] if decibels else ["the same", "the same"]
    off = f"{100 * mean(e['over_5_percent'] for e in errors):.3f} %"
    return [title, *(f"{100 * share:.1f} %" for share in saved), *psnr, off, remarks]


def every_eighth(inferred: Measured, first: int = 0) -> list[str]:
    """Options that ask for every eighth of its frames."""
    numbers = sorted({number for number, _ in inferred.frames})
    return ["-f", ",".join(map(str, numbers[first::8])), "-q", "full"]


def walks(out: Path, size: list[str]) -> Iterator[list[str]]:
    """Scenes that stand still, by each quality."""
    for name in STILL:
        if not SCENES[name].exists():
            continue
        full = Measured(SCENES[name], out / "full", *size, "-q", "full")
        for quality in ("half-pixel", "centred", "verified"):
            inferred = Measured(SCENES[name], out / quality, *size, "-q", quality, "--audit")
            yield row(f"{name}, {quality}", inferred, full, inferred.hidden())


def paper(out: Path, _size: list[str]) -> Iterator[list[str]]:
    """The paper's tables: frames 1-24 and 25-599 of buzz-city."""
    size = ["-r", "640x480"]
    full = Measured(SCENES["buzz-city"], out / "full", *size, "-q", "full")
    every = (*ALL, "reflection", "refraction")
    for quality in ("half-pixel", "centred"):
        inferred = Measured(SCENES["buzz-city"], out / quality, *size, "-q", quality)
        for first, last in ((1, 24), (25, 599)):
            span = range(first, last + 1)
            saved = [f"{100 * (1 - inferred.rays(k, span=span) / full.rays(k, span=span)):.1f} %" for k in (ALL, every)]
            remarks = f"frames {first}-{last}: {saved[0]} of these rays saved, {saved[1]} of all"
            yield row(f"buzz-city, {quality}", inferred, full, remarks)


def moving(out: Path, size: list[str]) -> Iterator[list[str]]:
    """Scenes in which bodies or lights move, or light changes."""
    shared = WALKS.parent
    exports = sorted((shared / "blender_export").glob("*.glb"))
    lights = shared / "conf_camera/lights_animated.gltf"
    for scene in (SCENES["stage"], without_lantern(out / "scene"), SCENES["kaykit_dungeon_walk"], lights, *exports):
        try:
            plan = json.loads(run(BINARY, "plan", scene, "--format", "json", "-r", "16x9"))
        except subprocess.CalledProcessError:  # Not there, or without a camera, as it has said.
            continue
        if len(plan["frames"]) > 1:
            full = Measured(scene, out / "full", *size, "-q", "full")
            yield row(scene.stem, Measured(scene, out / "centred", *size), full)


def without_lantern(folder: Path) -> Path:
    """Stage without the one light that moves."""
    shutil.copytree(SCENES["stage"].parent, folder, dirs_exist_ok=True)
    scene = json.loads(SCENES["stage"].read_text())
    for light in scene["extensions"]["KHR_lights_punctual"]["lights"]:
        if light["name"] == "Lantern light":
            light["intensity"] = 0
    target = folder / "stage_without_lantern.gltf"
    target.write_text(json.dumps(scene))
    return target


def soft(out: Path, size: list[str]) -> Iterator[list[str]]:
    """Courtyard under soft light: 16 rays to each light and to the sky."""
    scene = SCENES["courtyard"]
    options = [*size, *SOFT, "--compression", "none"]
    inferred = Measured(scene, out / "centred", *options)
    full = Measured(scene, out / "full", *options, "-q", "full", "-f", "4,20,36,52,68,84")
    slow, fast = full.seconds(), inferred.seconds()
    times = f"{slow:.3f} over {fast:.3f} s a frame: {slow / fast:.1f} times as fast"
    yield row("courtyard, soft", inferred, full, times)
    many = ["--light-samples", "256", "--ambient-samples", "256", "-q", "full", "-f", "52"]
    exact = Measured(scene, out / "exact", *size, *many)
    for sequence in (inferred, full):
        compared = json.loads(run(BINARY, "compare", sequence.out, exact.out, "--format", "json"))
        quality = sequence.report["settings"]["quality"]
        remarks = f"{compared['frames'][0]['psnr_db']:.1f} dB against 256 rays in frame 52"
        yield [f"courtyard, soft, {quality}", *[""] * 6, remarks]


def stereo(out: Path, size: list[str]) -> Iterator[list[str]]:
    """Right eyes of the scenes that stand still."""
    for name in STILL:
        if SCENES[name].exists():
            pair = ["--stereo", str(INTEROCULAR[name])]
            inferred = Measured(SCENES[name], out / "centred", *size, *pair)
            full = Measured(SCENES[name], out / "full", *size, *pair, *every_eighth(inferred, 4))
            yield row(f"{name}, right eyes", inferred, full, eye="right")


def antialias(out: Path, size: list[str]) -> Iterator[list[str]]:
    """Super-sampled pictures."""
    for name in ("courtyard", "breakfast_dolly"):
        if SCENES[name].exists():
            inferred = Measured(SCENES[name], out / "centred", *size, "--aa", "3")
            full = Measured(SCENES[name], out / "full", *size, "--aa", "3", *every_eighth(inferred))
            yield row(f"{name}, --aa 3", inferred, full)


def main() -> None:
    """Measures, and prints the table."""
    parts = {part.__name__: part for part in (walks, paper, moving, soft, stereo, antialias)}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("parts", nargs="*", default=list(parts), help=", ".join(parts))
    parser.add_argument("--resolution", default="1280x720")
    args = parser.parse_intermixed_args()
    found = []
    for name in args.parts:
        for cells in parts[name](args.out / name, ["-r", args.resolution]):
            print(" | ".join(cells), flush=True)
            found.append(cells)
        shutil.rmtree(args.out / name, ignore_errors=True)
    print(f"\ncommit {run('git', '-C', str(ROOT), 'rev-parse', '--short', 'HEAD').strip()}\n\n{table(TITLES, found)}")


if __name__ == "__main__":
    main()
