"""Courses, vehicles, presets and baselines with damaged texts, checked and flown."""

from __future__ import annotations

import random
from functools import partial
from pathlib import Path

from quadsim.course import COURSES
from quadsim.vehicle import VEHICLES
from tests.fuzz.damage import damaged_bytes, damaged_text
from tests.fuzz.flags import TINY
from tests.fuzz.harness import Case

PRESET = """base: race
mppi: {samples: 128, horizon: 20, target_ess: 20}
cost: {progress: 2.0}
sampling: {gamma: 0.5}
"""
SHORT = tuple(word for pair in TINY.items() for word in pair)
VARIANT = "+".join(f"{name[2:]}={value}" for name, value in TINY.items())
BASELINE = f"course: figure8\nvariant: {VARIANT}\nattempts: 4\n"


def texts() -> dict[str, list[str]]:
    """Return the texts that are damaged, by kind."""
    root = Path(COURSES)
    courses = [p.read_text() for p in sorted(root.glob("**/*.yaml"))]
    return {
        "course": courses,
        "vehicle": [p.read_text() for p in sorted(Path(VEHICLES).glob("*.yaml"))],
        "preset": [PRESET],
        "baseline": [BASELINE],
    }


def yamls(rng: random.Random) -> Case:
    """Return a case with one damaged file.

    It is mostly checked, as `race check` does everything that a flight does before it flies.
    """
    kind = rng.choice(("course", "course", "course", "vehicle", "vehicle", "preset", "baseline"))
    text = rng.choice(texts()[kind])
    if rng.random() < 0.85:
        damaged = damaged_text(rng, text).encode()
    else:
        damaged = damaged_bytes(rng, text.encode())
    flown = {"course": ("fly", "f.yaml"), "vehicle": ("fly", "paper_flat", "--vehicle", "f.yaml")}
    flown |= {"preset": ("fly", "paper_flat", "--preset", "f.yaml")}
    if kind == "baseline":
        argv = ("regress", "f.yaml", "--jobs", "0")
    elif rng.random() < 0.7:
        argv = ("check", "f.yaml", *(["--json"] * rng.choice((0, 0, 1))))
    else:
        argv = (*flown[kind], *SHORT)
    return Case("yaml", f"{kind} {' '.join(argv)} {damaged!r}", argv, partial(_write, damaged))


def _write(data: bytes, folder: Path) -> None:
    (folder / "f.yaml").write_bytes(data)
