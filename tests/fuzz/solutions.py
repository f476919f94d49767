"""Damaged and foreign solutions of `race limit`, read by every command that reads them."""

from __future__ import annotations

import json
import random
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

from quadsim.limit.limits import SOLUTIONS, dump, load
from tests.fuzz.arrays import arrays_in, damage_place, damaged_npz
from tests.fuzz.base import SHORT, base
from tests.fuzz.harness import Case, Outcome
from tests.fuzz.pilots import sound

# Keys of the races that the commands below read
INFORMED = "split_s_swift_swift_3_rates_margin0.03_reserve0.002_*"
FLOWN = "figure8_swift_3_rotors_*"
RATES = ("--model", "rates", "--margin", "0.03", "--reserve", "0.002")
TINY = ("--samples", "128", "--horizon", "20", "--iterations", "1", "--timeout", "0.1")
COMMANDS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (INFORMED, ("fly", "split_s_swift", "--preset", "race_informed", *TINY)),
    (INFORMED, ("fly", "split_s_swift", "--preset", "race_informed", *TINY, "--json")),
    (INFORMED, ("limit", "split_s_swift", *RATES, "--known")),
    (INFORMED, ("limit", "split_s_swift", *RATES, "--known", "--json")),
    (FLOWN, ("limit", "figure8", "--known", "--json")),
    (FLOWN, ("show",)),
    (FLOWN, ("show", "--json")),
    (FLOWN, ("plot",)),
    (FLOWN, ("export", "--html")),
    (FLOWN, ("compare", "figure8", *SHORT, "--attempts", "1", "--jobs", "1")),
)
# Share by which the damaged file is faster than the project's, so that it would be taken
FASTER = 0.01


def solutions(rng: random.Random) -> Case:
    """Return a case with a damaged solution among the runs.

    It is refused with one line, or counts as none, or is read as it was.
    """
    seed = rng.randrange(2**32)
    name, argv = rng.choice(COMMANDS)
    label = f"solution damaged by seed {seed}: {' '.join(argv)}"
    return Case("solutions", label, argv, partial(_prepare, name, seed), partial(_sound, name))


def _prepare(name: str, seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    (original,) = SOLUTIONS.glob(name)
    (flown,) = [run for run in base().runs if "figure8" in run.name]
    shutil.copytree(flown, folder / "runs" / flown.name)
    limits = folder / "runs" / "limits"
    limits.mkdir()
    data = faster(original)
    if rng.random() < 0.15:
        # the solution of another race, under the name of this one
        data = rng.choice(
            [path for path in SOLUTIONS.glob("*.npz") if path != original]
        ).read_bytes()
    else:
        data = damaged_npz(rng, data, "facts")
    damage_place(rng, limits / original.name, data)


def faster(path: Path, share: float = FASTER) -> bytes:
    """Return a solution that says to be faster by a share than it is."""
    stored = load(path)
    laps = tuple((1.0 - share) * time for time in stored.lap_times)
    solution = replace(stored.solution, t=(1.0 - share) * stored.solution.t)
    return dump(replace(stored, lap_times=laps, solution=solution))


def _sound(name: str, folder: Path, outcome: Outcome) -> str:
    """Claim what pilots claim, and that a limit that is told is near that of the project."""
    problem = sound(folder, outcome)
    if problem or not outcome.out.startswith("{"):
        return problem
    told = json.loads(outcome.out)
    # the report of a run has its limit as an entry, that of `race limit` is one
    limit = told.get("limit", told)
    if not limit or limit.get("time") is None:
        return ""
    (original,) = SOLUTIONS.glob(name)
    time = float(arrays_in(original.read_bytes())["t"][-1])
    if not 0.95 * time < limit["time"] < 1.05 * time:
        return f"a limit of {limit['time']} s, expected about {time} s"
    return ""
