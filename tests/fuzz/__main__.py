"""`make fuzz`: seeded cases, counted by kind, failures with what reproduces them. Exit code 1 if there are any."""

from __future__ import annotations

import argparse
import multiprocessing as mp
import random
import sys
import time
from collections import Counter
from importlib import import_module

from tests.fuzz.harness import Case, run

SHARES = {  # kind -> part of the cases
    "flags": 0.25, "yamls": 0.25, "runs": 0.15,
}  # fmt: skip
LOADED = ("quadsim.app.fly", "controllers.rollout.lanes", "pybullet", "matplotlib.figure", "web.page.export", "optuna")


def cases(kind: str, number: int, seed: int) -> list[Case]:
    """Case i depends on the seed and i alone."""
    make = getattr(import_module(f"tests.fuzz.{kind}"), kind)
    return [make(random.Random(f"{seed} {kind} {i}")) for i in range(number)]


def _timed(place: tuple[str, int, int]) -> tuple[str, int, str, str, float]:
    kind, i, seed = place
    case = cases_of(kind, i, seed)
    began = time.perf_counter()
    return case.kind, i, case.label, run(case), time.perf_counter() - began


def cases_of(kind: str, i: int, seed: int) -> Case:
    return getattr(import_module(f"tests.fuzz.{kind}"), kind)(random.Random(f"{seed} {kind} {i}"))


def main() -> int:
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("kinds", nargs="*", default=list(SHARES))
    ask.add_argument("--cases", type=int, default=1200)
    ask.add_argument("--seed", type=int, default=0)
    ask.add_argument("--jobs", type=int, default=2)
    ask.add_argument("--only", type=int, help="the number of one case")
    said = ask.parse_args()
    for module in LOADED:
        import_module(module)
    places = [(k, i, said.seed) for k in said.kinds for i in range(round(said.cases * SHARES[k]))]
    if said.only is not None:
        places = [(k, said.only, said.seed) for k in said.kinds]
    from tests.fuzz.base import base

    base()
    flown, failed, seconds = Counter(), Counter(), Counter()
    with mp.get_context("fork").Pool(said.jobs) as pool:
        for kind, i, label, problem, took in pool.imap_unordered(_timed, places):
            flown[kind] += 1
            seconds[kind] += took
            if problem:
                failed[kind] += 1
                print(f"FAILED {kind} {i} (seed {said.seed}): {problem}\n    race {label[:300]}", flush=True)
    for kind, n in flown.items():
        print(f"{kind:<14}{n:>6} cases {failed[kind]:>5} failed {seconds[kind]:>8.0f} s")
    print(f"{'all':<14}{flown.total():>6} cases {failed.total():>5} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
