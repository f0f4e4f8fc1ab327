"""Rendering and reading sequences, for the tests of what is made from them."""

import os
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR

ROOT = Path(__file__).resolve().parent.parent
BUZZ = Path(os.environ.get("BUZZ_CONVERT", ROOT / "target" / "release" / "buzz-convert"))


def buzz(*arguments: str | Path) -> str:
    """Runs the program and returns what it printed; fails with what it said."""
    run = subprocess.run([BUZZ, *arguments], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


def convert(scene: Path, out: Path, *options: str) -> None:
    """Renders a scene."""
    buzz(scene, out, *options, "--progress", "none")


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """The channels of a file, as floats."""
    file = OpenEXR.File(str(path), separate_channels=True)
    return {name: channel.pixels.astype(np.float32) for name, channel in file.channels().items()}
