#!/usr/bin/env python3
"""Makes the table of README.md: renders this folder's scenes in full and inferred, and compares the two.

    cargo build --release
    python3 scenes/measure.py OUT [scene ...] [--rounds 3]

Each round renders a scene with `-q full`, then inferred in each quality, so that whatever else the machine does meets
all alike; times are those of the round with the median ratio. CPU seconds say what was worked, whoever else had the
processor. The pictures stay in OUT/<scene>/<quality>.
"""

import argparse
import json
import os
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
SIZES = {"courtyard": "1280x720", "gallery": "1280x720", "buzz-city": "640x480", "stage": "1280x720"}
INFERRED = ("half-pixel", "centred")
HEADER = ["scene", "pixels", "quality", "frames", "traced in full", "rays saved", "all rays saved"]
HEADER += ["PSNR mean", "worst", "wall s", "times as fast", "CPU s", "times less CPU"]


def convert(binary: Path, scene: str, quality: str, out: Path) -> dict:
    """Renders a scene; returns the totals of its report, with the CPU seconds used."""
    gltf = HERE / scene / f"{scene}.gltf"
    command = [binary, gltf, out, "-q", quality, "-r", SIZES[scene], "--overwrite", "--progress", "none"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"{gltf}: buzz-convert ended with {process.returncode}")
    totals = json.loads((out / "report.json").read_text())["totals"]
    totals["seconds"]["cpu"] = usage.ru_utime + usage.ru_stime
    return totals


def compare(binary: Path, out: Path, quality: str) -> dict:
    """The error of an inferred sequence against the traced one."""
    command = [binary, "compare", out / quality, out / "full", "--format", "json"]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def ratio(pair: tuple[dict, dict], clock: str) -> float:
    full, inferred = pair
    return full["seconds"][clock] / inferred["seconds"][clock]


def saved(pair: tuple[dict, dict], kinds: tuple[str, ...]) -> str:
    full, inferred = (sum(totals["rays"][kind] for kind in kinds) for totals in pair)
    return f"{100 * (1 - inferred / full):.1f} %"


def measure(binary: Path, scene: str, out: Path, rounds: int) -> list[list[str]]:
    """The rows of a scene, one for each quality."""
    made = []
    for _ in range(rounds):
        made.append({quality: convert(binary, scene, quality, out / quality) for quality in ("full", *INFERRED)})
    return [row(binary, scene, out, quality, [(r["full"], r[quality]) for r in made]) for quality in INFERRED]


def row(binary: Path, scene: str, out: Path, quality: str, pairs: list[tuple[dict, dict]]) -> list[str]:
    """One row of the table."""
    by_wall = sorted(pairs, key=lambda pair: ratio(pair, "wall"))[len(pairs) // 2]
    by_cpu = sorted(pairs, key=lambda pair: ratio(pair, "cpu"))[len(pairs) // 2]
    error = compare(binary, out, quality)
    first = pairs[0]

    def seconds(pair: tuple[dict, dict], clock: str) -> str:
        return " / ".join(f"{totals['seconds'][clock]:.1f}" for totals in pair)

    return [
        scene,
        SIZES[scene],
        quality,
        str(first[1]["frames"]),
        str(first[1]["traced_frames"]),
        saved(first, ("primary", "visibility", "shadow")),
        saved(first, tuple(first[0]["rays"])),
        f"{error['inferred_mean']['psnr_db']:.1f} dB",
        f"{error['worst']['psnr_db']:.1f} dB",
        seconds(by_wall, "wall"),
        f"{ratio(by_wall, 'wall'):.2f}",
        seconds(by_cpu, "cpu"),
        f"{ratio(by_cpu, 'cpu'):.2f}",
    ]


def main() -> None:
    """Prints the table as Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", nargs="*", default=list(SIZES))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--binary", type=Path, default=HERE.parent / "target/release/buzz-convert")
    args = parser.parse_args()
    print("| " + " | ".join(HEADER) + " |\n|" + "---|" * len(HEADER), flush=True)
    for scene in args.scenes:
        for cells in measure(args.binary, scene, args.out / scene, args.rounds):
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
