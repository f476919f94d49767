"""A race as files: a page that plays offline, a CSV table, a zip, a PNG; and the panel that offers
them."""

from __future__ import annotations

import csv
import io
import secrets
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import viser
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from quadsim.record.archive import load_run
from quadsim.record.run import RunError, columns_of
from web.competitor import Competitor, named, stored_competitor
from web.lap_timing import lap_timings
from web.page.camera import set_initial_camera
from web.page.guard import serve
from web.page.html import text
from web.page.laps import laps
from web.page.race_scene import RaceScene
from web.race import Snapshot
from web.session import Session

GROUND, LINE = "#141517", 20  # of a picture: the page's dark ground; height of a line of text [px]
RATE = 25  # frames a second
RENDER_TIMEOUT = 30.0  # [s] for a browser that draws in software


def add_export(gui: viser.GuiApi, session: Session) -> viser.GuiButtonGroupHandle:
    """What is on the page, as downloads of the client that asks. -> their buttons"""
    with gui.add_folder("Export", expand_by_default=False):
        hint = "page: animated, plays offline; PNG: the view"
        what = gui.add_button_group("", ("page", "CSV", "zip", "PNG"), hint=hint)

    def send(event: viser.GuiEvent) -> None:
        if event.client is None:
            return
        try:
            name, data = _download(event.client, what.value, session.snapshot)
        except (RunError, ValueError, RuntimeError, TimeoutError, OSError) as error:
            event.client.add_notification(
                "Cannot export", str(error), auto_close_seconds=6.0, color="red"
            )
        else:
            event.client.send_file_download(name, data, save_immediately=True)

    what.on_click(send)
    return what


def _download(client: viser.ClientHandle, what: str, s: Snapshot) -> tuple[str, bytes]:
    """Its name and content."""
    if what == "PNG":
        return "race.png", picture(_rendered(client), [e.until(s.t) for e in s.competitors])
    folders = [e.folder for e in s.competitors if e.folder]
    if not folders:
        raise ValueError("nothing is stored yet: a flight is kept when it ends")
    name = folders[0].name
    if what == "page":
        return f"{name}.html", offline_page(named([stored_competitor(f) for f in folders])).encode()
    if what == "CSV":
        return f"{name}.csv", telemetry_csv(folders)
    return f"{name}.zip", zipped(folders)


def _rendered(client: viser.ClientHandle) -> np.ndarray:
    """The scene as this visitor sees it, without a background.  (height, width, 4) uint8"""
    camera = client.camera
    return client.get_render(
        camera.image_height, camera.image_width, transport_format="png", timeout=RENDER_TIMEOUT
    )


def picture(render: np.ndarray, entries: Sequence[Competitor]) -> bytes:
    """A PNG: the scene on the page's dark ground, which can be read on white paper too; above it a
    line a run."""
    height, width = render.shape[:2]
    band = LINE * len(entries) + 10  # pixels
    figure = Figure(figsize=(width / 100, (height + band) / 100), dpi=100, facecolor=GROUND)
    ground = 255 * np.array(to_rgb(GROUND))
    share = render[..., 3:] / 255
    figure.figimage((share * render[..., :3] + (1 - share) * ground).astype(np.uint8))
    for k, e in enumerate(entries):
        laps = "  ".join(f"{lap:.3f}" for lap in e.laps)
        words = f"{e.course.name}  {e.name}  laps {laps or '-'} s  {e.outcome or 'flying'} at {e.t[-1]:.2f} s"
        y = 1 - (8 + LINE * (k + 0.5)) / (height + band)
        figure.text(
            12 / width, y, words, color=e.style.colour, fontsize=9, va="center", parse_math=False
        )
    data = io.BytesIO()
    figure.savefig(data, format="png")
    return data.getvalue()


def zipped(folders: Sequence[Path]) -> bytes:
    """The run folders as they are on the disk."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in (p for folder in folders for p in sorted(folder.iterdir()) if p.is_file()):
            archive.write(path, f"{path.parent.name}/{path.name}")
    return data.getvalue()


def telemetry_csv(folders: Sequence[Path]) -> bytes:
    """One row a control step; the header has column and unit, `px [m]`. Of several runs the first
    column is the run.

    Raises RunError for a damaged run, and for runs with other columns than the first has.
    """
    lines, several, runs = (
        io.StringIO(newline=""),
        len(folders) > 1,
        [load_run(folder) for folder in folders],
    )
    columns, out = columns_of(runs[0].spec), csv.writer(lines)
    out.writerow(["run"] * several + [f"{name} [{unit}]" for name, unit in columns.items()])
    for folder, run in zip(folders, runs, strict=True):
        if columns_of(run.spec) != columns:
            raise RunError(
                f"{folder}: a table of several runs needs runs of one system, got others than the first's"
            )
        names = [[folder.name] * len(run.telemetry["t"])] * several
        out.writerows(zip(*names, *(run.telemetry[name].tolist() for name in columns), strict=True))
    return lines.getvalue().encode()


def offline_page(entries: Sequence[Competitor]) -> str:
    """HTML that plays the race without a network. Recorded from a server of its own, closed by a
    random token."""
    server = serve("127.0.0.1", 0, secrets.token_urlsafe(), "race")
    try:
        return _with_laps(_record(server, entries), entries)
    finally:
        server.stop()


def _record(server: viser.ViserServer, entries: Sequence[Competitor]) -> str:
    course, end = entries[0].course, max(float(e.t[-1]) for e in entries)
    scene = RaceScene(server.scene, entries, samples=8)
    centres = course.points(frames=False)[1:]  # of the gates [m]
    low, high = centres.min(axis=0), centres.max(axis=0)
    clock = server.scene.add_label("/clock", "", position=(*(low + high)[:2] / 2, high[2] + 3.0))
    set_initial_camera(server, course)
    recording = server.get_scene_serializer()
    for t in np.arange(0.0, end + 1.0 / RATE, 1.0 / RATE):
        timings = lap_timings(
            Snapshot(t=float(t), end=end, competitors=tuple(entries)), by_place=False
        )
        scene.update(timings, by_speed=len(entries) == 1)
        clock.text = f"{t:.1f} s  lap {timings[0].lap}"
        recording.insert_sleep(1.0 / RATE)
    return recording.as_html(dark_mode=True)


def _with_laps(page: str, entries: Sequence[Competitor]) -> str:
    """The page with a title and a table of laps in its corner."""
    title = f"{text(entries[0].course.name)}: {text(', '.join(e.name for e in entries))}"
    look = "position:fixed;left:12px;top:12px;z-index:9;max-width:420px;color:#e6e9ee;background:#1a1c20e6"
    body = f"<b style='padding:0 10px'>{title}</b>{laps(entries)}"
    corner = (
        f"<div style='{look};border-radius:6px;padding-top:8px;font-family:sans-serif'>{body}</div>"
    )
    head, _, tail = page.rpartition("</body>")
    return f"{head}{corner}</body>{tail}".replace(
        "<title>Viser</title>", f"<title>{title}</title>", 1
    )
