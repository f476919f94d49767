"""A race as files: a page that plays offline, a CSV table, a zip, a PNG."""

from __future__ import annotations

import io
import re
import secrets
import zipfile
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import NamedTuple

import numpy as np
import viser
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from quadsim.files.links import is_within
from quadsim.heat.archive import export_name, is_heat, runs_of_heat, with_whole_races
from quadsim.record.run import RunError
from quadsim.web.page.parts.elements import DIM, SHEET, Element, box, element, swatch, to_html
from quadsim.web.page.parts.laps import chatter, laps
from quadsim.web.page.scene.camera import set_initial_camera
from quadsim.web.page.scene.race_scene import RaceScene
from quadsim.web.page.server.page_server import serve
from quadsim.web.race.competitor import Competitor
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.summary import CompetitorLine, Summary, summary_at

GROUND = "#141517"  # background of a picture, the dark background of the page
LINE = 22  # height of a line of text in a picture [px]
DPI = 100
MOST_NAME = 120  # length of the name of a picture, at most [characters]
RATE = 25  # frames per second of the offline page
SAMPLES = 8  # number of stored sampled trajectories of a run


class PictureLine(NamedTuple):
    """A line of text in a picture."""

    text: str
    colour: str
    size: float  # [pt]


def picture_name(s: Snapshot) -> str:
    """Return the name of a picture, such as "figure8_colored_gaussian_2.50s"."""
    names = [s.competitors[0].course.name, *(entry.name for entry in s.competitors)]
    plain = "_".join(re.sub(r"[^0-9A-Za-z.-]+", "-", name).strip("-") for name in names)
    return f"{plain[:MOST_NAME]}_{s.t:.2f}s"


def picture(render: np.ndarray, summary: Summary) -> bytes:
    """Return a PNG of the scene on the page's dark background, below a summary of the race.

    The dark background makes the picture readable on white paper too.

    Args:
        render: (height, width, 4) uint8
        summary: the race in words.
    """
    height, width = render.shape[:2]
    lines = [PictureLine(summary.headline, "#ffffff", 12)]
    if summary.compared:
        lines.append(PictureLine(summary.compared, DIM, 9))
    lines += [PictureLine(one.text, one.entry.style.colour, 9) for one in summary.lines]
    total = height + LINE * len(lines) + 10
    figure = Figure(figsize=(width / DPI, total / DPI), dpi=DPI, facecolor=GROUND)
    opacity = render[..., 3:] / 255
    ground = 255 * np.array(to_rgb(GROUND))
    scene = opacity * render[..., :3] + (1 - opacity) * ground
    figure.figimage(scene.astype(np.uint8))
    for k, line in enumerate(lines):
        figure.text(
            x=12 / width,
            y=1 - (8 + LINE * (k + 0.5)) / total,
            s=line.text,
            color=line.colour,
            fontsize=line.size,
            va="center",
            parse_math=False,
        )
    data = io.BytesIO()
    figure.savefig(data, format="png")
    return data.getvalue()


def zipped(folders: Sequence[Path]) -> bytes:
    """Return a zip of run folders as they are on the disk; unzipped, they can be read again.

    A race of which all runs are given is there as a whole, with its heat.json.

    Raises:
        RunError: a file is a link that leads out of its folder, or the race has no runs.
    """
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for folder in with_whole_races(folders):
            name = export_name(folder)
            runs = runs_of_heat(folder) if is_heat(folder) else []
            for place in (folder, *runs):
                inside = f"{name}/{place.relative_to(folder)}" if place != folder else name
                for path in sorted(place.iterdir()):
                    if not is_within(path, place):
                        wanted = "expected a file of the run"
                        raise RunError(f"{path}: {wanted}, got a link out of its folder")
                    if path.is_file():
                        archive.write(path, f"{inside}/{path.name}")
    return data.getvalue()


def offline_page(entries: Sequence[Competitor]) -> str:
    """Return HTML that plays a race without a network.

    The page is recorded from a separate server, protected by a random token.
    """
    server = serve("127.0.0.1", 0, secrets.token_urlsafe(), "race")
    try:
        return _with_laps(_record(server, entries), entries)
    finally:
        server.stop()


def _record(server: viser.ViserServer, entries: Sequence[Competitor]) -> str:
    """Return viser's page with the race as a recording."""
    course = entries[0].course
    end = max(entry.last_t for entry in entries)
    scene = RaceScene(server.scene, entries, samples=SAMPLES)
    gates = course.points(frames=False)[1:]  # centres [m]
    low = gates.min(axis=0)
    high = gates.max(axis=0)
    above = (*(low + high)[:2] / 2, high[2] + 3.0)
    clock = server.scene.add_label("/clock", "", position=above)
    set_initial_camera(server, course)
    recording = server.get_scene_serializer()
    for t in np.arange(0.0, end + 1.0 / RATE, 1.0 / RATE):
        now = Snapshot(t=float(t), end=end, competitors=tuple(entries))
        timings = lap_timings(now)
        scene.update(timings, by_speed=len(entries) == 1)
        clock.text = f"{t:.1f} s  lap {timings[0].lap}"
        recording.insert_sleep(1.0 / RATE)
    return recording.as_html(dark_mode=True)


def _coloured_line(line: CompetitorLine) -> Element:
    """Return the line of a competitor in its colour."""
    style = line.entry.style
    text = element("span", line.text, look="coloured", values={"colour": style.colour})
    return element("div", swatch(style), text)


def _with_laps(page: str, entries: Sequence[Competitor]) -> str:
    """Return a page with a title and a table of laps in its corner."""
    names = ", ".join(entry.name for entry in entries)
    title = f"{entries[0].course.name}: {names}"
    summary = summary_at(entries, inf)
    said = [element("b", title), summary.headline, summary.compared]
    corner = element(
        "div",
        element("div", *(element("div", line) for line in said if line), look="about"),
        box(*(_coloured_line(one) for one in summary.lines)),
        laps(entries),
        chatter(entries),
        look="export-corner",
    )
    head, _, tail = page.rpartition("</body>")
    whole = f"{head}<style>{SHEET.read_text()}</style>{to_html(corner)}</body>{tail}"
    return whole.replace("<title>Viser</title>", f"<title>{to_html(title)}</title>", 1)
