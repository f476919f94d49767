"""Fly a random course: gates on a wavy ring, written as YAML and checked."""

import numpy as np
import yaml

import quadsim

rng = np.random.default_rng(4)
angles = np.linspace(0.0, 2 * np.pi, 7)[:-1]
radii = rng.uniform(7.0, 11.0, 6)  # [m]
heights = rng.uniform(1.8, 4.0, 6)  # [m]
gates = []
for angle, radius, height in zip(angles, radii, heights, strict=True):
    x = radius * np.cos(angle)
    y = radius * np.sin(angle)
    yaw_deg = np.degrees(angle) + 90.0
    gates.append({"position": [float(x), float(y), float(height)], "yaw_deg": float(yaw_deg % 360)})
course = {
    "loop": True,
    "laps": 1,
    "opening": [1.6, 1.6],
    "start": {"position": [8.0, -5.0, 1.5], "yaw_deg": 60.0},
    "gates": gates,
}
with open("random_course.yaml", "w") as file:
    yaml.safe_dump(course, file)
run = quadsim.fly("random_course.yaml")
print(run.outcome, run.laps)
