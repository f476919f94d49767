"""A race as one HTML page that plays without a network: the scene, its laps beside it."""

from __future__ import annotations

import secrets
from collections.abc import Sequence

import numpy as np
import viser

from web.camera import FOV, overview
from web.competitor import Competitor
from web.drone import Drone, SampledTrajectoriesView
from web.guard import serve
from web.html import text
from web.lap_timing import lap_timings
from web.laps import laps
from web.race import Snapshot
from web.race_scene import show_kept
from web.scene import CourseView, visible_scale
from web.timing import hit_gates

RATE = 25  # pictures a second


def record(competitors: Sequence[Competitor]) -> str:
    """The HTML. Recorded from a server of its own that nobody can enter."""
    server = serve("127.0.0.1", 0, secrets.token_urlsafe(), "race")
    try:
        return _with_laps(_play(server, competitors), competitors)
    finally:
        server.stop()


def _play(server: viser.ViserServer, competitors: Sequence[Competitor]) -> str:
    scene, course = server.scene, competitors[0].course
    view = CourseView(scene, course)
    drones = [
        Drone(scene, str(k), competitor, k > 0, visible_scale(course)) for k, competitor in enumerate(competitors)
    ]
    sampled_trajectories = SampledTrajectoriesView(scene, samples=8)
    clock = scene.add_label("/clock", "", position=clock_place(competitors[0]))
    camera = server.initial_camera
    camera.position, camera.look_at = overview(course)
    camera.fov = FOV
    tape = server.get_scene_serializer()
    end = max(float(competitor.t[-1]) for competitor in competitors)
    for t in np.arange(0.0, end + 1.0 / RATE, 1.0 / RATE):
        all_ = lap_timings(Snapshot(t=float(t), end=end, competitors=tuple(competitors)), by_place=False)
        for drone, s in zip(drones, all_, strict=True):
            drone.show(s.competitor, s.i, by_speed=len(competitors) == 1)
        view.colour(all_[0].gate, hit_gates(all_))
        show_kept(sampled_trajectories, all_[0])
        clock.text = f"{t:.1f} s  lap {all_[0].lap}"
        tape.insert_sleep(1.0 / RATE)
    return tape.as_html(dark_mode=True)


def clock_place(competitor: Competitor) -> np.ndarray:
    """Above the middle of the course [m]."""
    points = np.array([g.position for g in competitor.course.gates])
    return np.append((points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2, points[:, 2].max() + 3.0)


def _with_laps(page: str, competitors: Sequence[Competitor]) -> str:
    """The page with a title and a table of laps in its corner."""
    course = competitors[0].course.name
    title = f"{text(course)}: {text(', '.join(competitor.name for competitor in competitors))}"
    look = "position:fixed;left:12px;top:12px;z-index:9;max-width:420px;color:#e6e9ee;background:#1a1c20e6"
    body = f"<b style='padding:0 10px'>{title}</b>{laps(competitors)}"
    corner = f"<div style='{look};border-radius:6px;padding-top:8px;font-family:sans-serif'>{body}</div>"
    head, _, tail = page.rpartition("</body>")
    return f"{head}{corner}</body>{tail}".replace("<title>Viser</title>", f"<title>{title}</title>", 1)
