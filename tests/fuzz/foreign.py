"""Courses of other simulators with damaged texts, converted with and without flags."""

from __future__ import annotations

import random
from functools import partial
from pathlib import Path

from quadsim.course import parse_course
from quadsim.files.strict_yaml import FileError
from tests.course.test_foreign import AIRSIM_JSON, TABLE, TEXTS
from tests.fuzz.damage import WORDS, damaged_bytes, damaged_json, damaged_text
from tests.fuzz.harness import Case, Outcome

OUT = "out.yaml"
# Flags of the conversion, with values that they take
GOOD = (
    ("--frame", "ned"), ("--frame", "enu"), ("--unit", "cm"), ("--unit", "ft"), ("--angles", "deg"),
    ("--angles", "rad"), ("--passage", "auto"), ("--passage", "either"), ("--passage=-y",),
    ("--opening", "1.5", "1.5"), ("--gates", "1,2"), ("--gates=-2,1",),
    ("--start", "0", "0", "2", "90"),
    ("--offset", "0", "0", "9"), ("--loop",), ("--json",),
)  # fmt: skip


def foreign(rng: random.Random) -> Case:
    """Return a case with one damaged file; what is written has to be a course."""
    kind = rng.choice(tuple(TEXTS))
    text = rng.choice(
        {"airsim": (TEXTS[kind], AIRSIM_JSON), "csv": (TEXTS[kind], TABLE)}.get(
            kind, (TEXTS[kind],)
        )
    )
    if text == AIRSIM_JSON and rng.random() < 0.7:
        damaged = damaged_json(rng, text).encode()
    elif rng.random() < 0.85:
        damaged = damaged_text(rng, text).encode()
    else:
        damaged = damaged_bytes(rng, text.encode())
    flags = [word for pair in rng.sample(GOOD, rng.choice((0, 0, 1, 2))) for word in pair]
    if flags and rng.random() < 0.2:
        flags[rng.randrange(len(flags))] = rng.choice(WORDS).replace("\x00", "")
    named = kind if rng.random() < 0.95 else rng.choice(tuple(TEXTS))
    argv = ("convert", "f.txt", "--from", named, "--out", OUT, *flags)
    label = f"{kind} {' '.join(argv)} {damaged!r}"
    return Case("foreign", label, argv, partial(_write, damaged), after=_is_course)


def _write(data: bytes, folder: Path) -> None:
    (folder / "f.txt").write_bytes(data)


def _is_course(folder: Path, outcome: Outcome) -> str:
    """Return what is wrong with the written course: there is one if and only if the code is 0."""
    out = folder / OUT
    if out.exists() != (outcome.code == 0):
        return f"exit code {outcome.code}, and the course is {'' if out.exists() else 'not '}there"
    if out.exists():
        try:
            parse_course(out.read_text(), OUT)
        except FileError as error:
            return f"the course cannot be read: {error}"
    return ""
