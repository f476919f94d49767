"""A random course: gates on a wavy ring, written as YAML, checked and flown."""

import numpy as np
import yaml

import quadsim

rng = np.random.default_rng(4)
angle = np.linspace(0.0, 2 * np.pi, 7)[:-1]
radius, height = rng.uniform(7.0, 11.0, 6), rng.uniform(1.8, 4.0, 6)
gates = [
    {
        "position": [float(r * np.cos(a)), float(r * np.sin(a)), float(z)],
        "yaw_deg": float(np.degrees(a) + 90.0) % 360.0,
    }
    for a, r, z in zip(angle, radius, height, strict=True)
]
course = {
    "loop": True,
    "laps": 1,
    "opening": [1.6, 1.6],
    "start": {"position": [8.0, -5.0, 1.5], "yaw_deg": 60.0},
}
with open("random_course.yaml", "w") as file:
    yaml.safe_dump(course | {"gates": gates}, file)
run = quadsim.fly("random_course.yaml")
print(run.outcome, run.laps)
