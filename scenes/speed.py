#!/usr/bin/env python3
"""How much faster an inferred frame is than a traced one, and what bounds it: a table for docs/performance.md.

    cargo build --release
    .venv/bin/python scenes/speed.py OUT [--resolution 1280x720] [--frames 20] [--segment 12] [scene ...]

`buzz-convert trade` renders the segments that hold the frames by every quality in turn, twice, without writing; the
faster round counts. `breakfast_eight` is breakfast_dolly with as many point lights more as make eight, `crowd_60` is
`build/crowd.py` with as many figures as its name says.
"""

import argparse
import json
import math
import os
import shutil
import sys
from pathlib import Path
from statistics import mean

from trade import ROOT, SCENES, processor, run, table

sys.path.insert(0, str(ROOT / "scenes" / "build"))
import crowd  # after the path: the scene scripts import each other by plain names

EIGHT = 8
TITLES = ["scene", "quality", "frames", "work instead of tracing", "camera and shadow rays", "shading, reflection"]
TITLES += ["in all", "times as fast", "work instead, of tracing"]
STAGES = ("infer", "trace", "enhance")


def add_lights(source: Path, target: Path) -> None:
    """Copies the folder of a glTF to that of `target`, which has eight lights: its own, and its point lights again."""
    shutil.copytree(source.parent, target.parent, dirs_exist_ok=True)
    scene = json.loads(source.read_text())
    nodes, lights = scene["nodes"], scene["extensions"]["KHR_lights_punctual"]["lights"]
    carried = [node for node in nodes if "KHR_lights_punctual" in node.get("extensions", {})]
    carried = [(node, node["extensions"]["KHR_lights_punctual"]["light"]) for node in carried]
    points = [(node, light) for node, light in carried if lights[light]["type"] == "point"]
    for number in range(EIGHT - len(carried)):
        node, light = points[number % len(points)]
        angle = 2.4 * number
        x, y, z = node["translation"]
        scene["scenes"][scene.get("scene", 0)]["nodes"].append(len(nodes))
        nodes.append(
            {
                "name": f"{node['name']} {number}",
                "translation": [x + math.cos(angle), y, z + math.sin(angle)],
                "extensions": {"KHR_lights_punctual": {"light": light}},
            }
        )
    target.write_text(json.dumps(scene))


def rows(name: str, trade: dict) -> list[list[str]]:
    """The rows of one scene: a traced frame, and an inferred one of each quality."""
    found, full = [], {}
    for measured in trade["qualities"]:
        is_full = measured["quality"] == "full"
        frames = [f["seconds"] for f in measured["frames"] if is_full or f.get("from") is not None]
        if not frames:
            continue
        stages = {stage: 1e3 * mean(seconds[stage] for seconds in frames) for stage in STAGES}
        full = full or stages
        total = sum(stages.values())
        found.append(
            [name, measured["quality"], str(len(frames)), *(f"{stages[s]:.0f}" for s in STAGES), f"{total:.0f}"]
        )
        found[-1] += (
            ["", ""]
            if is_full
            else [
                f"{sum(full.values()) / total:.2f}",
                f"{100 * stages['infer'] / full['trace']:.1f} %",
            ]
        )
    return found


def main() -> None:
    """Measures, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", nargs="*", default=["breakfast_dolly", "breakfast_eight", "sponza_walk_cut"])
    parser.add_argument("--resolution", default="1280x720")
    parser.add_argument("--frames", default="20")
    parser.add_argument("--segment", default="12")
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/buzz-convert")
    args = parser.parse_intermixed_args()
    args.out.mkdir(parents=True, exist_ok=True)
    found = []
    for name in args.scenes:
        scene = SCENES.get(name)
        if name == "breakfast_eight":
            scene = args.out / "eight" / "breakfast_eight.gltf"
            if SCENES["breakfast_dolly"].exists():
                add_lights(SCENES["breakfast_dolly"], scene)
        if name.startswith("crowd_"):
            scene = args.out / f"{name}.made" / "crowd.gltf"
            crowd.build(int(name.removeprefix("crowd_"))).write(scene.parent)
        if not scene.exists():
            print(f"skipped: {scene} is not there")
            continue
        out = args.out / name
        run(
            args.binary,
            "trade",
            scene,
            out,
            "-r",
            args.resolution,
            "-f",
            args.frames,
            "--segment",
            args.segment,
            "--progress",
            "none",
        )
        found += rows(name, json.loads((out / "trade.json").read_text()))
    commit = run("git", "-C", str(ROOT), "rev-parse", "--short", "HEAD").strip()
    cores = len(os.sched_getaffinity(0))
    print(f"Milliseconds a frame at {args.resolution}, commit {commit}, {cores} cores of {processor()}\n")
    print(table(TITLES, found))


if __name__ == "__main__":
    main()
