"""Screenshots of the pages that aatri writes, by the Chromium of the machine: see `make.py`."""

from __future__ import annotations

import io
import shutil
from pathlib import Path

PARTS = {
    "report": ("report.html", "#verdict", 780),
    "report_tests": ("report.html", "#tests", 520),
    "compared": ("compared.html", "main", 530),
}
"""By name: the page, what of it, and how much of its height, px."""
WIDTH, COLOURS = 1000, 48


def chromium() -> str | None:
    """The browser of the machine, if it has one."""
    return next((found for name in ("chromium", "google-chrome", "chrome") if (found := shutil.which(name))), None)


def taken(folder: Path) -> dict[str, bytes]:
    """PNG files by name, of few colours, from a folder with the pages."""
    from PIL import Image
    from playwright.sync_api import sync_playwright

    made = {}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": WIDTH, "height": 900}, color_scheme="light")
        for name, (file, part, height) in PARTS.items():
            page.goto((folder / file).absolute().as_uri())
            box = page.locator(part).bounding_box()
            clip = {"x": 0, "y": box["y"], "width": WIDTH, "height": min(height, box["height"])}
            image = Image.open(io.BytesIO(page.screenshot(full_page=True, clip=clip)))
            small = io.BytesIO()
            image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(small, "PNG", optimize=True)
            made[name] = small.getvalue()
        browser.close()
    return made
