#!/usr/bin/env python3
"""Makes docs/trade.md: `buzz-convert trade` on our scenes and those in ../shared/scenes/walk, beside interpolation.

    cargo build --release
    .venv/bin/python scenes/trade.py OUT [--resolution 1280x720] [--segment 24 --frames 20] [scene ...]

The pages with pictures stay in OUT/<scene>/trade.html. Interpolation by optical flow (`interpolate.py`) is measured
on the same frames, as far as it makes them: every fourth frame of the full sequence is given to it.
"""

import argparse
import json
import os
import platform
import subprocess
from pathlib import Path

import interpolate

ROOT = Path(__file__).resolve().parent.parent
WALKS = ROOT.parent / "shared" / "scenes" / "walk"
SCENES = {name: ROOT / "scenes" / name / f"{name}.gltf" for name in ("courtyard", "gallery", "buzz-city", "stage")}
SCENES |= {
    "breakfast_dolly": WALKS / "breakfast_dolly" / "breakfast_dolly.gltf",
    "gas_station_orbit_cut_whip": WALKS / "gas_station_orbit_cut_whip.glb",
    "sponza_walk_cut": WALKS / "sponza_walk_cut.glb",
    "zdm2_fastpan": WALKS / "zdm2_fastpan.glb",
    "kaykit_dungeon_walk": WALKS / "kaykit_dungeon_walk.glb",
}
TITLES = ["scene", "quality", "ms a frame", "inferred, ms (10-90 %)", "times as fast", "rays a pixel", "PSNR dB"]
TITLES += ["worst dB", "FLIP", "over 5 %", "hidden"]
DISTANCES = (1, 2, 4, 8, 12, 16)


def processor() -> str:
    """What the machine calls its processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def run(*command: str | Path) -> str:
    """What a command printed."""
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def baseline(binary: Path, scene: Path, out: Path, resolution: str, trade: dict) -> dict[str, float]:
    """Interpolation's error on the frames that were measured."""
    plan = json.loads(run(binary, "plan", scene, "--format", "json", "-r", "16x9", "-q", "full"))
    first, last = plan["frames"][0]["frame"], plan["frames"][-1]["frame"]
    # As far as there are measured frames, and what the flow of those at the ends is made from.
    first = max(first, min(a for a, _ in trade["spans"]) - interpolate.KEPT)
    last = min(last, max(b for _, b in trade["spans"]) + interpolate.KEPT)
    options = ["-q", "full", "-r", resolution, "-f", f"{first}-{last}", "--skip-existing", "--progress", "none"]
    run(binary, scene, out, *options)
    frames = {n for a, b in trade["spans"] for n in range(a, b + 1)}
    return interpolate.measure(out, frames, trade["exposure"])


def rows(name: str, trade: dict, flow: dict[str, float]) -> list[list[str]]:
    """The rows of one scene."""
    full = trade["qualities"][0]["summary"]["seconds"]["mean"]
    found = []
    for measured in trade["qualities"]:
        s = measured["summary"]
        error, spread = s["error"], s["inferred_seconds"]
        exact = error["psnr_db"] is None
        found.append(
            [
                name,
                measured["quality"],
                f"{1e3 * s['seconds']['mean']:.0f}",
                f"{1e3 * spread['median']:.0f} ({1e3 * spread['p10']:.0f}-{1e3 * spread['p90']:.0f})" if spread else "",
                f"{full / s['seconds']['mean']:.2f}",
                f"{s['rays_per_pixel']:.2f}",
                "exact" if exact else f"{error['psnr_db']:.1f}",
                "" if exact else f"{s['worst_db']:.1f}",
                "" if exact else f"{error['flip_mean']:.4f}",
                "" if exact else f"{100 * error['over_5_percent']:.1f} %",
                "" if s["hidden"] is None else f"{100 * s['hidden']:.2f} %",
            ]
        )
    # A frame in four is traced, the others are made from those.
    cost = 1e3 * (full + (interpolate.KEPT - 1) * flow["seconds"]) / interpolate.KEPT
    made = [f"{cost:.0f}", f"{1e3 * flow['seconds']:.0f}", f"{1e3 * full / cost:.2f}", ""]
    error = [f"{flow['psnr_db']:.1f}", f"{flow['worst_db']:.1f}"]
    found.append([name, "interpolated", *made, *error, "", "", ""])
    return found


def chain(name: str, trade: dict) -> list[list[str]]:
    """How the error moves along the chain: decibels at some distances."""
    found = []
    for measured in trade["qualities"][1:]:
        by_distance = {step["distance"]: step["psnr_db"] for step in measured["chain"]}
        cells = [f"{by_distance[d]:.1f}" if by_distance.get(d) is not None else "" for d in DISTANCES]
        found.append([name, measured["quality"], *cells])
    return found


def table(titles: list[str], cells: list[list[str]]) -> str:
    """Markdown."""
    lines = ["| " + " | ".join(titles) + " |", "|" + "---|" * len(titles)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in cells]) + "\n"


def main() -> None:
    """Measures, and writes docs/trade.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", nargs="*", default=list(SCENES))
    parser.add_argument("--resolution", default="1280x720")
    parser.add_argument("--segment", help="longest segment, as `buzz-convert trade` takes it")
    parser.add_argument("--frames", help="segments to measure, as `buzz-convert trade` takes them")
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/buzz-convert")
    args = parser.parse_intermixed_args()
    measured, chains, spans, noise = [], [], [], []
    commit = run("git", "-C", str(ROOT), "rev-parse", "--short", "HEAD").strip()
    for name in args.scenes:
        scene, out = SCENES[name], args.out / name
        if not scene.exists():
            print(f"skipped: {scene} is not there")
            continue
        chosen = {"--segment": args.segment, "--frames": args.frames}
        options = [word for name, value in chosen.items() if value for word in (name, value)]
        # A run that was stopped goes on where it was, if it was the same.
        same, this = out / "measured.json", json.dumps([commit, args.resolution, *options])
        if not same.exists() or same.read_text() != this:
            print(run(args.binary, "trade", scene, out, "-r", args.resolution, *options), flush=True)
            same.write_text(this)
        trade = json.loads((out / "trade.json").read_text())
        flow = baseline(args.binary, scene, out / "full", args.resolution, trade)
        measured += rows(name, trade, flow)
        chains += chain(name, trade)
        spans.append(f"{name} {', '.join(f'{a}-{b}' for a, b in trade['spans'])}")
        noise.append(max(m["summary"]["noise"] for m in trade["qualities"]))
        write(commit, " ".join(["--resolution", args.resolution, *options]), measured, chains, spans, max(noise))


def write(
    commit: str,
    options: str,
    measured: list[list[str]],
    chains: list[list[str]],
    spans: list[str],
    noise: float,
) -> None:
    """Writes docs/trade.md as far as it is known: after each scene, so that a run that is stopped leaves something."""
    machine = f"{len(os.sched_getaffinity(0))} cores of {processor()}"
    scenes = " ".join(dict.fromkeys(row[0] for row in measured))
    parts = [
        HEAD.format(commit=commit, machine=machine, options=options, scenes=scenes, noise=100 * noise),
        table(TITLES, measured),
        MIDDLE,
        table(["scene", "quality", *map(str, DISTANCES)], chains),
        "\nSegments measured: " + "; ".join(spans) + ".\n",
    ]
    (ROOT / "docs" / "trade.md").write_text("".join(parts))


HEAD = """# What each quality costs

Written by `.venv/bin/python scenes/trade.py OUT {options} {scenes}`: `buzz-convert trade`
on each scene ([what it does](review.md#trade)), commit {commit}, {machine}. Every frame was rendered
twice, the qualities in turn; the slower round took up to {noise:.0f} % longer (median over frames, noisiest scene and
quality).

*ms a frame* is without writing, key frames counted in. *Times as fast* is against `full`. *Hidden* is the share of
reused samples that another surface hides. PSNR, FLIP and *over 5 %* are of frames that are not identical to the
truth, compared as `buzz-convert compare` does. Frames that are nearly exact lift a mean
of dB: look at *worst dB*, too.

*Interpolated* is the baseline without a renderer: every fourth frame is traced, optical flow makes the three between
(`ffmpeg`'s `minterpolate`, `scenes/interpolate.py`). Its error is that of the made frames among those measured; its
time a frame is a quarter of a traced frame's and three quarters of a made one's, which stands under *inferred*.

"""

MIDDLE = """
## Along the chain

PSNR by frames from the key frame.

"""


if __name__ == "__main__":
    main()
