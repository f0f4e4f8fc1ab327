"""The baseline without a renderer: every fourth frame is kept, optical flow (`ffmpeg`'s minterpolate) makes the others.

    python3 scenes/interpolate.py FULL_DIR [--frames 41-59,60-77] [--exposure 0.8]

FULL_DIR holds a sequence traced in full, of any frame rate: only its order counts. Frames are compared as
`buzz-convert compare` does (exposed, clamped, sRGB), the kept ones left out. Prints JSON: mean and worst PSNR in
decibels, and the seconds that interpolation took for each frame it made, reading and writing pictures included.
Needs numpy, OpenEXR, and ffmpeg or imageio-ffmpeg.
"""

import argparse
import json
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenEXR

KEPT = 4
PADDING = 2
# Bidirectional motion estimation with overlapped blocks of varying size: minterpolate's best.
FLOW = "minterpolate=fps={rate}:mi_mode=mci:mc_mode=aobmc:me_mode=bidir:vsbmc=1"


def ffmpeg() -> str:
    """The program's path."""
    found = shutil.which("ffmpeg")
    if found is None:
        import imageio_ffmpeg

        found = imageio_ffmpeg.get_ffmpeg_exe()
    return found


def encoded(path: Path, exposure: float) -> np.ndarray:
    """A frame as a screen shows it, 0 to 1."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    linear = np.clip(np.stack([channels[c].pixels.astype(np.float32) for c in "RGB"], axis=2) * exposure, 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def automatic_exposure(files: list[Path]) -> float:
    """0.8 over the 99th percentile of the brightest channel, as `compare` exposes."""
    brightest = []
    for path in files:
        channels = OpenEXR.File(str(path), separate_channels=True).channels()
        brightest.append(np.max([channels[c].pixels.astype(np.float32) for c in "RGB"], axis=0).ravel())
    return 0.8 / (float(np.quantile(np.concatenate(brightest), 0.99)) or 1.0)


def interpolate(pictures: list[np.ndarray]) -> tuple[list[np.ndarray], float]:
    """All pictures from every fourth of them, and the seconds it took. Those after the last kept one cannot be made."""
    height, width, _ = pictures[0].shape
    kept = [(p * 255 + 0.5).astype(np.uint8) for p in pictures[::KEPT]]
    # It needs to see motion before it interpolates, and holds the last frames back until it knows what follows: so the
    # motion is mirrored at both ends.
    kept = kept[PADDING:0:-1] + kept + kept[-2 : -2 - PADDING : -1]
    size = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    with tempfile.TemporaryDirectory() as name:
        source, target = Path(name) / "in.rgb", Path(name) / "out.rgb"
        source.write_bytes(b"".join(k.tobytes() for k in kept))
        flow = f"format=yuv444p,{FLOW.format(rate=24)},format=rgb24"
        command = [ffmpeg(), "-v", "error", *size, "-r", str(24 / KEPT), "-i", source, "-vf", flow]
        command += ["-f", "rawvideo", target]
        start = time.monotonic()
        subprocess.run(command, check=True)
        seconds = time.monotonic() - start
        made = np.frombuffer(target.read_bytes(), np.uint8).reshape(-1, height, width, 3)
    count = (len(pictures) - 1) // KEPT * KEPT + 1
    return [frame.astype(np.float32) / 255 for frame in made[PADDING * KEPT :][:count]], seconds


def decibels(a: np.ndarray, b: np.ndarray) -> float:
    """Peak signal-to-noise ratio of encoded pictures."""
    return float(-10 * np.log10(max(np.mean((a - b) ** 2), 1e-12)))


def ranges(text: str) -> set[int]:
    """`1-3,7-9` as numbers."""
    pairs = [part.split("-") for part in text.split(",")]
    return {n for first, last in pairs for n in range(int(first), int(last) + 1)}


def measure(folder: Path, frames: set[int] | None = None, exposure: float | None = None) -> dict[str, float]:
    """The baseline's error on `frames` (all if not given)."""
    files = sorted(folder.glob("*.exr"))
    numbers = [int(path.stem.rsplit(".", 1)[-1]) for path in files]
    pictures = [encoded(path, exposure or automatic_exposure(files)) for path in files]
    made, seconds = interpolate(pictures)
    interpolated = [i for i in range(len(made)) if i % KEPT]
    counted = [i for i in interpolated if frames is None or numbers[i] in frames]
    errors = [decibels(made[i], pictures[i]) for i in counted]
    return {
        "frames": len(errors),
        "psnr_db": float(np.mean(errors)),
        "worst_db": float(np.min(errors)),
        "seconds": seconds / len(interpolated),
    }


def main() -> None:
    """Prints what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--frames", type=ranges)
    parser.add_argument("--exposure", type=float)
    args = parser.parse_args()
    print(json.dumps(measure(args.folder, args.frames, args.exposure)))


if __name__ == "__main__":
    main()
