"""report.html and trade.html in headless Chromium: they fetch nothing, work with the keyboard, and are accessible.

Chromium is the system's (`chromium`, `google-chrome`, or the one that the variable CHROMIUM names), else the one that
`playwright install chromium` has brought. Without any, the tests say so and skip.
"""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from PIL import Image
from playwright.sync_api import Browser, Error, Page, expect, sync_playwright
from sequences import ROOT, buzz, convert

COURTYARD = ROOT / "scenes/courtyard/courtyard.gltf"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium without a window. Its sandbox does not start as root, and it is shown nothing but our own pages."""
    names = ("chromium", "chromium-browser", "google-chrome")
    path = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, names)), None)
    with sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-background-networking"])
        except Error as error:
            pytest.skip(f"no Chromium: {str(error).splitlines()[0]}")
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A report and a trade of courtyard, across its cut; the second half of the report's frames was there already."""
    out = tmp_path_factory.mktemp("pages")
    convert(COURTYARD, out / "frames", "-r", "320x180", "-f", "60-69")
    convert(COURTYARD, out / "frames", "-r", "320x180", "-f", "50-69", "--skip-existing", "--report", str(out / "frames/report.json"))
    buzz("trade", COURTYARD, out / "trade", "-r", "96x54", "-f", "50-69")
    return {"report": out / "frames/report.html", "trade": out / "trade/trade.html"}


def open_page(browser: Browser, path: Path, **options: str) -> tuple[Page, list[str]]:
    """The page, and everything that it asked for or complained about."""
    page = browser.new_page(viewport={"width": 1100, "height": 900}, **options)
    said: list[str] = []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: said.append(request.url) if not request.url.startswith(("file:", "data:")) else None)
    page.goto(path.as_uri())
    return page, said


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["report", "trade"])
def test_pages_are_accessible_and_ask_for_nothing(browser: Browser, pages: dict[str, Path], name: str, scheme: str) -> None:
    """No request, no message in the console, nothing serious found by axe, in light and in dark."""
    page, said = open_page(browser, pages[name], color_scheme=scheme)
    for details in page.locator("summary").all():
        details.click()
    found = Axe().run(page).response["violations"]
    serious = [f"{v['id']}: {v['nodes'][0]['html'][:120]}" for v in found if v["impact"] in ("serious", "critical")]
    assert serious == []
    assert said == []
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    dark = sum(map(int, background[4:-1].split(","))) < 3 * 128
    assert dark == (scheme == "dark")
    shots = os.environ.get("SCREENSHOTS")
    if shots:
        page.screenshot(path=f"{shots}/{name}-{scheme}.png", full_page=True)


def shown(page: Page) -> tuple[str, str]:
    """What the caption says, and the beauty that is shown."""
    return page.inner_text("#caption"), page.get_attribute("img[data-layer=beauty]", "src") or ""


def test_the_scrubber_goes_through_the_frames(browser: Browser, pages: dict[str, Path]) -> None:
    """By the slider, the keyboard, a click on a chart and the button; frames that were there already have pictures too."""
    page, said = open_page(browser, pages["report"])
    first = shown(page)
    assert first[0].startswith("Frame 50:") and first[1].startswith("data:image/jpeg")
    page.keyboard.press("ArrowRight")
    second = shown(page)
    assert second[0].startswith("Frame 51:") and second[1] != first[1]
    page.keyboard.press("End")
    assert shown(page)[0].startswith("Frame 69:") and "was there already" in shown(page)[0]
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Home")
    assert shown(page) == first
    page.focus("#frame")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert shown(page)[0].startswith("Frame 52:")
    page.locator("svg[aria-label=Timeline] rect").nth(14).click()
    assert shown(page)[0].startswith("Frame 64:")
    assert page.locator("rect.current").first.get_attribute("data-frame") == "64"
    page.click("#play")
    expect(page.locator("#caption")).not_to_contain_text("Frame 64:")
    page.click("#play")
    assert page.inner_text("#play") == "Play"
    for layer in ("beauty", "class", "depth"):
        size = page.evaluate(f"(i => [i.naturalWidth, i.naturalHeight])(document.querySelector('img[data-layer={layer}]'))")
        assert size == [256, 144], layer
    assert said == []


def test_the_pictures_are_not_black_and_print_well(browser: Browser, pages: dict[str, Path], tmp_path: Path) -> None:
    """A screenshot of the frames has light and colour; printing leaves out what cannot be pressed on paper."""
    page, _ = open_page(browser, pages["report"])
    picture = tmp_path / "pictures.png"
    page.locator(".pictures").screenshot(path=picture)
    values = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    assert values.std() > 25 and np.ptp(values, axis=2).max() > 100
    page.emulate_media(media="print")
    assert not page.is_visible("#play") and page.is_visible("img[data-layer=beauty]")
    assert len(page.pdf()) > 10_000
