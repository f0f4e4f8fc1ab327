"""Makes the pictures of docs/gallery.md: the pages as Chromium shows them, a contact sheet, mattes.

    python docs/pictures/review/make_pictures.py

Needs what the tests need (tests/requirements.txt), Chromium, and a built buzz-convert (target/release). Run it from the
repository's root, so that no other folder's name is in the pictures.
"""

from __future__ import annotations

import colorsys
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image
from playwright.sync_api import sync_playwright

HERE = Path(__file__).resolve().parent
CONVERT = "target/release/buzz-convert"
SCENE = "scenes/courtyard/courtyard.gltf"


def run(*arguments: str | Path) -> None:
    """Runs the program without its messages."""
    subprocess.run([CONVERT, *arguments, "-r", "640x360", "--progress", "none"], check=True, stdout=subprocess.DEVNULL)


def save(picture: Image.Image, name: str) -> None:
    """As JPEG: these are looked at, not measured."""
    picture.convert("RGB").save(HERE / f"{name}.jpg", quality=82, optimize=True)


def screenshots(pages: list[tuple[Path, str, str, str]]) -> None:
    """Pages in light or dark, after a key was pressed (if any), from the top."""
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        for file, scheme, click, name in pages:
            page = browser.new_page(viewport={"width": 1040, "height": 1300}, color_scheme=scheme)
            page.goto(file.resolve().as_uri())
            if click:
                page.locator(click).nth(11).click()
            shot = Path(folder) / "shot.png"
            page.screenshot(path=shot)
            save(Image.open(shot), name)
        browser.close()


def mattes(file: Path) -> Image.Image:
    """The mattes of objects and of materials: each id in a colour of its own."""
    channels = OpenEXR.File(str(file), separate_channels=True).channels()
    parts = []
    for layer in ("CryptoObject", "CryptoMaterial"):
        bits = channels[f"{layer}00.R"].pixels.view(np.uint32)
        colors = np.zeros((*bits.shape, 3), np.uint8)
        for number in np.unique(bits[bits != 0]):
            hue, value = number % 360 / 360, 0.55 + number // 360 % 45 / 100
            colors[bits == number] = [round(255 * c) for c in colorsys.hsv_to_rgb(hue, 0.6, value)]
        parts.append(colors)
    return Image.fromarray(np.concatenate(parts, axis=1))


def main() -> None:
    """All of them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        frames, trade = folder / "frames", folder / "trade"
        run(SCENE, frames, "-f", "41-77", "--aov", "depth,class,crypto")
        run("trade", SCENE, trade, "-f", "41-59")
        report = next(frames.glob("*.html"))
        timeline = "svg[aria-label=Timeline] rect"
        screenshots([(report, "light", timeline, "report"), (report, "dark", "", "report-dark"), (trade / "trade.html", "light", "", "trade")])
        save(Image.open(next(frames.glob("*.review")) / "sheet.png"), "sheet")
        save(mattes(frames / "courtyard.0070.exr"), "mattes")


if __name__ == "__main__":
    main()
