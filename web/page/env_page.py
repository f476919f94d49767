"""EnvPage: the course and the vehicles of a learning environment, on a page of this machine.

The page shows them in real time, for an environment that is made with it:

    from quadsim.web.page.env_page import EnvPage
    env = gymnasium.make("quadsim/Racing-v0", render_mode="web", viewer=EnvPage)
"""

from __future__ import annotations

import logging
from time import perf_counter, sleep

import numpy as np

from quadsim.course import Course
from quadsim.dynamics.quadrotor import ATTITUDE, POSITION
from quadsim.palette import style
from quadsim.web.page.scene.camera import set_initial_camera
from quadsim.web.page.scene.drones import ROTOR_COLOUR, SPAN, add_lights, add_quadrotor
from quadsim.web.page.scene.race_scene import CourseView, visible_scale
from quadsim.web.page.server.page_server import address, serve

HOST = "127.0.0.1"
MOST = 32  # largest number of drawn vehicles
SCENE = 1 / 25  # period of the scene [s]
log = logging.getLogger("quadsim")  # without configured logging: one line on stderr


class EnvPage:
    """A server on a free port of this machine, whose address is logged in one line.

    Args:
        course: the course.
        vehicles: number of vehicles.
        dt: duration of a step, also on the page [s].
    """

    def __init__(self, course: Course, vehicles: int, dt: float):
        self._server = serve(HOST, 0, None, "environment", has_shell=False)
        scene = self._server.scene
        self._server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        add_lights(scene)
        CourseView(scene, course)
        set_initial_camera(self._server, course)
        span = SPAN * visible_scale(course)
        colour = style("colored").rgb
        self._frames = []
        for k in range(min(vehicles, MOST)):
            frame = scene.add_frame(f"/vehicle/{k}", show_axes=False)
            add_quadrotor(scene, f"/vehicle/{k}", span, colour, rotors=ROTOR_COLOUR)
            self._frames.append(frame)
        self._dt = dt
        self._next = perf_counter()
        self._drawn = 0.0
        log.warning(f"environment: watch it at {address(HOST, self._server.get_port())}")

    def show(self, states: np.ndarray) -> None:
        """Wait until this step is due, and draw the first vehicles.

        Args:
            states: position, velocity and quaternion wxyz of each vehicle  (vehicles, 10)
        """
        now = perf_counter()
        # Lost time is dropped.
        self._next = max(self._next + self._dt, now)
        sleep(self._next - now)
        if self._next - self._drawn < SCENE:
            return
        self._drawn = self._next
        with self._server.atomic():
            for frame, x in zip(self._frames, states, strict=False):
                frame.position = x[POSITION]
                frame.wxyz = x[ATTITUDE]

    def close(self) -> None:
        """Stop the server."""
        self._server.stop()
