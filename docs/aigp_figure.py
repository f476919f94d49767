"""The picture of aigp.md, in some seconds: `.venv/bin/python docs/aigp_figure.py`."""

from __future__ import annotations

from math import radians

import numpy as np
from PIL import Image
from shared import DOCS

from quadsim.course import load_course
from quadsim.mavlink.pictures import Eye
from quadsim.rotation import from_euler
from quadsim.sensing.camera import load_camera

BEFORE = 6.0  # distance from the gate [m]
PITCHES = (0.0, 20.0)  # the nose down [deg]


def main() -> None:
    course = load_course("aigp_physical")
    gate = course.gates[0]
    x, y, z = (np.array(gate.position) - BEFORE * np.array(gate.axes[0])).tolist()
    eye = Eye(course, load_camera("aigp"))
    pictures = [
        eye.picture((x, y, z), from_euler(gate.yaw, radians(pitch), 0.0)) for pitch in PITCHES
    ]
    Image.fromarray(np.hstack(pictures)).save(DOCS / "aigp.png", optimize=True)


if __name__ == "__main__":
    main()
