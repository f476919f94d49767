"""A race as files: a page that plays offline, a CSV table, a zip, a PNG; and the panel that offers them."""

from __future__ import annotations

import csv
import io
import secrets
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import viser
from matplotlib.image import imsave

from quadsim.record.archive import load_run
from quadsim.record.run import Run, RunError, columns_of
from web.competitor import Competitor, named, stored_competitor
from web.lap_timing import lap_timings
from web.page.camera import set_initial_camera
from web.page.guard import serve
from web.page.html import text
from web.page.laps import laps
from web.page.race_scene import RaceScene
from web.race import Snapshot
from web.session import Session

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
            event.client.add_notification("Cannot export", str(error), auto_close_seconds=6.0, color="red")
        else:
            event.client.send_file_download(name, data, save_immediately=True)

    what.on_click(send)
    return what


def _download(client: viser.ClientHandle, what: str, s: Snapshot) -> tuple[str, bytes]:
    """Its name and content."""
    if what == "PNG":
        return "race.png", _png(client)
    folders = [e.folder for e in s.competitors if e.folder]
    if not folders:
        raise ValueError("nothing is stored yet: a flight is kept when it ends")
    name = folders[0].name
    if what == "page":
        return f"{name}.html", offline_page(named([stored_competitor(f) for f in folders])).encode()
    if what == "CSV":
        return f"{name}.csv", telemetry_csv(load_run(folders[0]))
    return f"{name}.zip", zipped(folders[0])


def _png(client: viser.ClientHandle) -> bytes:
    data, camera = io.BytesIO(), client.camera
    render = client.get_render(camera.image_height, camera.image_width, transport_format="png", timeout=RENDER_TIMEOUT)
    imsave(data, render, format="png")
    return data.getvalue()


def zipped(folder: Path) -> bytes:
    """The run folder as it is on the disk."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(p for p in folder.iterdir() if p.is_file()):
            archive.write(path, f"{folder.name}/{path.name}")
    return data.getvalue()


def telemetry_csv(run: Run) -> bytes:
    """One row a control step; the header has column and unit, `px [m]`."""
    lines = io.StringIO(newline="")
    out = csv.writer(lines)
    columns = columns_of(run.spec)
    out.writerow([f"{name} [{unit}]" for name, unit in columns.items()])
    out.writerows(zip(*(run.telemetry[name].tolist() for name in columns), strict=True))
    return lines.getvalue().encode()


def offline_page(entries: Sequence[Competitor]) -> str:
    """HTML that plays the race without a network. Recorded from a server of its own, closed by a random token."""
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
        timings = lap_timings(Snapshot(t=float(t), end=end, competitors=tuple(entries)), by_place=False)
        scene.update(timings, by_speed=len(entries) == 1)
        clock.text = f"{t:.1f} s  lap {timings[0].lap}"
        recording.insert_sleep(1.0 / RATE)
    return recording.as_html(dark_mode=True)


def _with_laps(page: str, entries: Sequence[Competitor]) -> str:
    """The page with a title and a table of laps in its corner."""
    title = f"{text(entries[0].course.name)}: {text(', '.join(e.name for e in entries))}"
    look = "position:fixed;left:12px;top:12px;z-index:9;max-width:420px;color:#e6e9ee;background:#1a1c20e6"
    body = f"<b style='padding:0 10px'>{title}</b>{laps(entries)}"
    corner = f"<div style='{look};border-radius:6px;padding-top:8px;font-family:sans-serif'>{body}</div>"
    head, _, tail = page.rpartition("</body>")
    return f"{head}{corner}</body>{tail}".replace("<title>Viser</title>", f"<title>{title}</title>", 1)
