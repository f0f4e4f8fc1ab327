#!/usr/bin/env python3
"""Two machines' worth of a farm on one: how much sooner two runs with half of the tasks each are done than one run.

    cargo build --release
    python3 tests/side_by_side.py OUT [--scene scenes/buzz-city/buzz-city.gltf] [-r 320x240] [--rounds 3]

Renders with one thread in one process, then with one thread in each of two `openjd run`, which take every other task of the
template; prints both walls, and ends with 1 if the frames are not the same or the ratio's median is over 0.65.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUZZ = Path(os.environ.get("BUZZ_CONVERT", ROOT / "target" / "release" / "buzz-convert"))
PATH = os.pathsep.join([str(BUZZ.parent), str(Path(sys.executable).parent), os.environ["PATH"]])
QUIET = {"stdout": subprocess.DEVNULL, "env": os.environ | {"PATH": PATH}}


def wall(*commands: list) -> float:
    """Seconds until all of the commands are done that begin at the same time."""
    began = time.monotonic()
    running = [subprocess.Popen(command, **QUIET) for command in commands]
    if [process.returncode for process in running if process.wait()]:
        raise SystemExit("a run failed")
    return time.monotonic() - began


def frames(folder: Path) -> dict[str, bytes]:
    """Every frame in a folder by its name."""
    return {path.name: path.read_bytes() for path in folder.glob("*.exr")}


def main() -> None:
    """Runs it and prints the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scene", type=Path, default=ROOT / "scenes" / "buzz-city" / "buzz-city.gltf")
    parser.add_argument("-r", "--resolution", default="320x240")
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    plan = [BUZZ, "plan", args.scene, "-r", args.resolution, "-j", "1", "--format", "openjd"]
    template, one, two = args.out / "job.json", args.out / "one", args.out / "two"
    template.write_bytes(subprocess.run(plan, check=True, capture_output=True).stdout)
    (space,) = json.loads(template.read_text())["steps"][0]["parameterSpace"]["taskParameterDefinitions"]
    tasks = [{"Chunk": chunk} for chunk in space["range"]]
    run = ["openjd", "run", template, "-p", f"Input={args.scene}", "-p", f"OutputDir={two}", "--step", "Render"]

    ratios = []
    for _ in range(args.rounds):
        for folder in (one, two):
            shutil.rmtree(folder, ignore_errors=True)
        alone = wall([BUZZ, args.scene, one, "-r", args.resolution, "-j", "1", "--progress", "none"])
        both = wall(*([*run, "--tasks", json.dumps(tasks[half::2])] for half in range(2)))
        ratios.append(both / alone)
        print(f"{len(tasks)} tasks: one process {alone:.1f} s, two {both:.1f} s: {ratios[-1]:.2f}", flush=True)
        if frames(one) != frames(two):
            raise SystemExit("the frames differ")
    print(f"{len(frames(one))} frames, the same; ratio {statistics.median(ratios):.2f}")
    if statistics.median(ratios) > 0.65:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
