#!/usr/bin/env python3
"""A long render that is killed again and again ends with the frames of one that is left alone.

    cargo build --release
    python3 tests/endurance.py OUT

Renders 2,000 frames of buzz-city at 320x240, its camera's path played to and fro: once undisturbed, watching that memory
does not grow, then with a `kill -9` every few seconds and `--skip-existing` after each. Ends with 1 if a frame differs, if
anything is left over, or if memory grows. `test_endurance.py` does the same with few frames.
"""

import argparse
import json
import os
import random
import shutil
import struct
import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "scenes" / "buzz-city" / "buzz-city.gltf"
BUZZ = Path(os.environ.get("BUZZ_CONVERT", ROOT / "target" / "release" / "buzz-convert"))
SIZES = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def to_and_fro(frames: int, folder: Path) -> Path:
    """Writes buzz-city with its camera's path played forward, backward, forward ... for so many frames."""
    document = json.loads(SCENE.read_text())
    data = bytearray((SCENE.parent / document["buffers"][0]["uri"]).read_bytes())

    def values(index: int) -> list[tuple[float, ...]]:
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        size, at = SIZES[accessor["type"]], view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        numbers = struct.unpack_from(f"<{size * accessor['count']}f", data, at)
        return list(zip(*[iter(numbers)] * size, strict=True))

    def accessor(kind: str, rows: list[tuple[float, ...]]) -> int:
        packed = struct.pack(f"<{len(rows) * SIZES[kind]}f", *(n for row in rows for n in row))
        document["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(packed)})
        data.extend(packed)
        bounds = {"min": list(map(min, zip(*rows, strict=True))), "max": list(map(max, zip(*rows, strict=True)))}
        view = len(document["bufferViews"]) - 1
        document["accessors"].append({"bufferView": view, "componentType": 5126, "count": len(rows), "type": kind, **bounds})
        return len(document["accessors"]) - 1

    fps = document["scenes"][0]["extras"]["buzz"]["fps"][0]
    times = accessor("SCALAR", [(i / fps,) for i in range(frames)])
    for sampler in document["animations"][0]["samplers"]:
        path = values(sampler["output"])
        period = 2 * len(path) - 2
        there = [min(i % period, period - i % period) for i in range(frames)]
        sampler["input"] = times
        sampler["output"] = accessor(f"VEC{len(path[0])}", [path[i] for i in there])
    document["scenes"][0]["extras"]["buzz"]["frame_end"] = frames - 1
    document["buffers"][0] = {"uri": "to-and-fro.bin", "byteLength": len(data)}
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copytree(SCENE.parent / "textures", folder / "textures", dirs_exist_ok=True)
    (folder / "to-and-fro.bin").write_bytes(data)
    (folder / "to-and-fro.gltf").write_text(json.dumps(document))
    return folder / "to-and-fro.gltf"


def start(scene: Path, out: Path, resolution: str) -> subprocess.Popen:
    """Starts a run that takes up what is there."""
    command = [BUZZ, scene, out, "-r", resolution, "--skip-existing", "--progress", "none"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def finish(process: subprocess.Popen) -> list[int]:
    """Waits for a run to end well; returns the bytes that it held resident, ten times a second."""
    held = []
    while process.poll() is None:
        fields = Path(f"/proc/{process.pid}/statm").read_text().split()
        held.append(4096 * int(fields[1]) if len(fields) > 1 else 0)
        time.sleep(0.1)
    if process.returncode != 0:
        raise SystemExit(f"buzz-convert ended with {process.returncode}")
    return [bytes_ for bytes_ in held if bytes_]


def torment(scene: Path, out: Path, resolution: str, seconds: tuple[float, float], moments: random.Random) -> int:
    """Kills runs at random moments until one comes to its end; returns how many were killed.

    A run first checks what is there, which takes the longer the more it is and the busier the machine: after one that got no
    further, the next has twice the time.
    """
    kills, patience, done = 0, 1.0, 0
    while True:
        process = start(scene, out, resolution)
        try:
            code = process.wait(patience * moments.uniform(*seconds))
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            kills += 1
            before, done = done, len(list(out.glob("*.exr")))
            patience = 1.0 if done > before else 2 * patience
            continue
        if code != 0:
            raise SystemExit(f"buzz-convert ended with {code}")
        return kills


def differences(out: Path, reference: Path) -> list[str]:
    """Names that are in one of the folders only, or frames whose bytes differ."""
    names = {path.name for folder in (out, reference) for path in folder.iterdir() if not path.name.startswith("report")}
    same = [(out / n).is_file() and (reference / n).is_file() and (out / n).read_bytes() == (reference / n).read_bytes() for n in names]
    return sorted(name for name, equal in zip(names, same, strict=True) if not equal)


def main() -> None:
    """Runs it and prints the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames", type=int, default=2000)
    parser.add_argument("--resolution", default="320x240")
    parser.add_argument("--seconds", type=float, nargs=2, default=(2.0, 8.0), help="shortest and longest time until a kill")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    scene = to_and_fro(args.frames, args.out)
    calm, killed = args.out / "calm", args.out / "killed"

    began = time.monotonic()
    held = finish(start(scene, calm, args.resolution))
    # The first tenth reads the scene and fills the buffers.
    tenth = len(held) // 10
    early, late = max(held[tenth : 3 * tenth]), max(held[-2 * tenth :])
    print(f"undisturbed: {args.frames} frames in {time.monotonic() - began:.0f} s")
    print(f"memory: {early / 2**20:.1f} MiB at most in the second and third tenth, {late / 2**20:.1f} MiB in the last two")

    began = time.monotonic()
    kills = torment(scene, killed, args.resolution, tuple(args.seconds), random.Random(args.seed))
    totals = json.loads((killed / "report.json").read_text())["totals"]
    print(f"killed {kills} times: {totals['frames']} frames in {time.monotonic() - began:.0f} s")
    different = differences(killed, calm)
    print(f"different: {', '.join(different) or 'none'}")
    if different or totals["frames"] != args.frames or late > 1.05 * early:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
