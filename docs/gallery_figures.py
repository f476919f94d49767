"""Fly the races of gallery.md and store them with their pictures, in a minute:

    .venv/bin/python docs/gallery_figures.py

It needs Chromium, which draws the pictures, and playwright.
"""

from __future__ import annotations

import io
import re
import shlex
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from quadsim.cli.cli import race

FOLDER = Path(__file__).parent
GALLERY = FOLDER / "gallery"
PAGE = FOLDER / "gallery.md"
SIZE = {"width": 1440, "height": 810}
SHOWN = 960  # width of a picture in the page [px]
WAIT = 8000  # until the scene is drawn by software [ms]
PATIENCE = 180_000  # for the picture itself on a slow machine [ms]
COMMAND = re.compile(r"^    (race .*)$", re.MULTILINE)
LINK = re.compile(r"\(gallery/(\w+)\.html\)")


def main() -> None:
    """Fly each section's commands, store the runs as a zip file, and draw its picture."""
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--use-angle=swiftshader"],
        )
        for name, commands in sections():
            runs = Path(folder) / name
            for command in commands:
                _run(*command, "--runs-dir", str(runs))
            stored = sorted(path.name for path in runs.iterdir() if path.is_dir())
            (GALLERY / f"{name}.zip").unlink(missing_ok=True)
            _run(
                "export",
                *stored,
                "--zip",
                "--out",
                f"{GALLERY / name}.zip",
                "--runs-dir",
                str(runs),
            )
            page = Path(folder) / f"{name}.html"
            _run("export", *stored, "--html", "--out", str(page), "--runs-dir", str(runs))
            _picture(browser, page).save(GALLERY / f"{name}.webp", quality=80)
        browser.close()


def sections() -> Iterator[tuple[str, list[list[str]]]]:
    """Yield the name of each race of the page, and the commands above it, without `race`."""
    for section in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        link = LINK.search(section)
        assert link is not None, f"{PAGE}: expected a link to gallery/NAME.html in: {section[:40]}"
        yield link[1], [shlex.split(command)[1:] for command in COMMAND.findall(section)]


def _run(*words: str) -> None:
    if status := race(list(words)):
        sys.exit(f"race {shlex.join(words)}: exit status {status}")


def _picture(browser: Browser, page: Path) -> Image.Image:
    tab = browser.new_page(viewport=SIZE)  # pyright: ignore[reportArgumentType]
    tab.goto(page.as_uri())
    tab.wait_for_timeout(WAIT)
    # Viser's notice that the scene is drawn by software
    tab.add_style_tag(content=".mantine-Notifications-root { display: none }")
    tab.wait_for_timeout(500)
    picture = Image.open(io.BytesIO(tab.screenshot(timeout=PATIENCE)))
    tab.close()
    return picture.resize((SHOWN, SHOWN * SIZE["height"] // SIZE["width"]))


if __name__ == "__main__":
    main()
