"""EnvPage: the course and the vehicles of a learning environment, on a page of this machine, in
real time."""

from __future__ import annotations

import logging
from time import perf_counter, sleep

import numpy as np

from quadsim.course import Course
from quadsim.dynamics.quadrotor import ATTITUDE, POSITION
from quadsim.palette import style
from web.page.camera import set_initial_camera
from web.page.drones import SPAN, add_lights, quadrotor, single_colour
from web.page.guard import address, serve
from web.page.race_scene import CourseView, visible_scale

HOST, MOST, SCENE = "127.0.0.1", 32, 1 / 25  # vehicles that are drawn, period of the scene [s]
log = logging.getLogger("quadsim")  # of a program that has not set up logging: one line on stderr


class EnvPage:
    """A server on a free port of this machine; where it listens is said in one line."""

    def __init__(self, course: Course, vehicles: int, dt: float):
        """dt: of a step [s], which takes as long on the page."""
        self._server = serve(HOST, 0, None, "environment")
        scene, body = self._server.scene, quadrotor(SPAN * visible_scale(course))
        self._server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        add_lights(scene)
        CourseView(scene, course)
        set_initial_camera(self._server, course)
        colour = {
            "body": single_colour(style("colored").rgb),
            "rotors": single_colour((205, 208, 212)),
        }
        self._frames = [
            scene.add_frame(f"/vehicle/{k}", show_axes=False) for k in range(min(vehicles, MOST))
        ]
        for k, (part, mesh) in (
            (k, part) for k in range(len(self._frames)) for part in body.items()
        ):
            look = {"color": colour[part], "flat_shading": True, "side": "double"}
            scene.add_mesh_simple(f"/vehicle/{k}/{part}", mesh.vertices, mesh.faces, **look)
        self._dt, self._next, self._drawn = dt, perf_counter(), 0.0
        log.warning(f"environment: watch it at {address(HOST, self._server.get_port())}")

    def show(self, states: np.ndarray) -> None:
        """Wait until this step's time has come, and draw the first vehicles.  (vehicles, 10): p, v,
        q wxyz"""
        now = perf_counter()
        self._next = max(self._next + self._dt, now)  # time that was lost is not caught up with
        sleep(self._next - now)
        if self._next - self._drawn < SCENE:
            return
        self._drawn = self._next
        with self._server.atomic():
            for frame, x in zip(self._frames, states, strict=False):
                frame.position = x[POSITION]
                frame.wxyz = x[ATTITUDE]

    def close(self) -> None:
        self._server.stop()
