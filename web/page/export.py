"""A race as files: a page that plays offline, a CSV table, a zip, a PNG; and the panel for them."""

from __future__ import annotations

import io
import secrets
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import viser
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from quadsim.files.links import is_within
from quadsim.heat.archive import (
    export_name,
    is_heat,
    named_runs,
    runs_of_heat,
    with_whole_races,
)
from quadsim.record.exchange import telemetry_csv
from quadsim.record.run import RunError
from web.competitor import Competitor, named
from web.lap_timing import lap_timings
from web.page.camera import Camera, set_initial_camera
from web.page.html import div, element, text
from web.page.laps import laps
from web.page.race_scene import RaceScene
from web.page.runs_panel import link_to, show_link
from web.page.server import serve
from web.race import Snapshot
from web.session import Session
from web.stored_runs import stored_competitor

GROUND = "#141517"  # background of a picture, the dark background of the page
LINE = 20  # height of a line of text in a picture [px]
DPI = 100
RATE = 25  # frames per second of the offline page
SAMPLES = 8  # number of stored sampled trajectories of a run
RENDER_TIMEOUT = 30.0  # time limit for a browser with software rendering [s]
NOTICE = 6.0  # duration of a notice [s]


class Download(NamedTuple):
    """A file for a visitor."""

    name: str
    data: bytes


def add_export(gui: viser.GuiApi, session: Session, camera: Camera) -> None:
    """Add buttons to download the content of the page, or to link to it."""
    with gui.add_folder("Export", expand_by_default=False):
        hint = "page: animated, plays offline; PNG: the view; link: an address that shows this"
        what = gui.add_button_group("", ("page", "CSV", "zip", "PNG", "link"), hint=hint)

    @what.on_click
    def _(event: viser.GuiEvent) -> None:
        client = event.client
        if client is None:
            return
        s = session.snapshot
        try:
            if what.value == "link":
                show_link(client, link_to(s.competitors, s.t, camera.mode_of(client), session.root))
                return
            file = _download(client, what.value, s)
        except (RunError, ValueError, RuntimeError, TimeoutError, OSError) as error:
            client.add_notification(
                "Cannot export", str(error), auto_close_seconds=NOTICE, color="red"
            )
        else:
            client.send_file_download(file.name, file.data, save_immediately=True)


def _download(client: viser.ClientHandle, what: str, s: Snapshot) -> Download:
    """Return the requested file."""
    if what == "PNG":
        entries = [entry.until(s.t) for entry in s.competitors]
        return Download("race.png", picture(_rendered(client), entries))
    folders = [entry.folder for entry in s.competitors if entry.folder]
    if not folders:
        raise ValueError("nothing is stored yet: a flight is kept when it ends")
    name = export_name(with_whole_races(folders)[0])
    if what == "page":
        entries = named([stored_competitor(folder) for folder in folders])
        return Download(f"{name}.html", offline_page(entries).encode())
    if what == "CSV":
        return Download(f"{name}.csv", telemetry_csv(named_runs(folders)))
    return Download(f"{name}.zip", zipped(folders))


def _rendered(client: viser.ClientHandle) -> np.ndarray:
    """Return the scene in a visitor's view, without a background.  (height, width, 4) uint8"""
    camera = client.camera
    return client.get_render(
        camera.image_height, camera.image_width, transport_format="png", timeout=RENDER_TIMEOUT
    )


def picture(render: np.ndarray, entries: Sequence[Competitor]) -> bytes:
    """Return a PNG of the scene on the page's dark background, below a line for each run.

    The dark background makes the picture readable on white paper too.

    Args:
        render: (height, width, 4) uint8
    """
    height, width = render.shape[:2]
    total = height + LINE * len(entries) + 10
    figure = Figure(figsize=(width / DPI, total / DPI), dpi=DPI, facecolor=GROUND)
    opacity = render[..., 3:] / 255
    ground = 255 * np.array(to_rgb(GROUND))
    scene = opacity * render[..., :3] + (1 - opacity) * ground
    figure.figimage(scene.astype(np.uint8))
    for k, entry in enumerate(entries):
        figure.text(
            x=12 / width,
            y=1 - (8 + LINE * (k + 0.5)) / total,
            s=_caption(entry),
            color=entry.style.colour,
            fontsize=9,
            va="center",
            parse_math=False,
        )
    data = io.BytesIO()
    figure.savefig(data, format="png")
    return data.getvalue()


def _caption(entry: Competitor) -> str:
    """Return the line of a run in a picture."""
    laps = "  ".join(f"{lap:.3f}" for lap in entry.laps) or "-"
    ended = f"{entry.outcome or 'flying'} at {entry.last_t:.2f} s"
    return f"{entry.course.name}  {entry.name}  laps {laps} s  {ended}"


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


def _with_laps(page: str, entries: Sequence[Competitor]) -> str:
    """Return a page with a title and a table of laps in its corner."""
    names = ", ".join(entry.name for entry in entries)
    title = f"{text(entries[0].course.name)}: {text(names)}"
    corner = div(
        element("b", title, padding="0 10px") + laps(entries),
        position="fixed",
        left="12px",
        top="12px",
        z_index=9,
        max_width="420px",
        color="#e6e9ee",
        background="#1a1c20e6",
        border_radius="6px",
        padding_top="8px",
        font_family="sans-serif",
    )
    head, _, tail = page.rpartition("</body>")
    whole = f"{head}{corner}</body>{tail}"
    return whole.replace("<title>Viser</title>", f"<title>{title}</title>", 1)
