"""`make fuzz`: seeded cases, counted by kind, failures with what reproduces them. Exit code 1 if
there are any."""

from __future__ import annotations

import argparse
import multiprocessing as mp
import random
import sys
import time
from collections import Counter
from importlib import import_module

from quadsim.cli.cli import COMMANDS
from tests.fuzz.base import base, campaign_base
from tests.fuzz.harness import Case, run

CASES = {  # kind -> how many
    "flags": 300, "yamls": 300, "runs": 200, "caches": 100, "databases": 150, "exports": 60,
    "disks": 60, "environments": 60,
}  # fmt: skip
LOADED = (
    "quadsim.cli.fly",
    "controllers.lanes.lanes",
    "pybullet",
    "matplotlib.figure",
    "web.page.export",
    "optuna",
)


def case_of(kind: str, i: int, seed: int) -> Case:
    """Depends on these three alone."""
    module = import_module(f"tests.fuzz.{'disks' if kind == 'exports' else kind}")
    return getattr(module, kind)(random.Random(f"{seed} {kind} {i}"))


def _timed(place: tuple[str, int, int]) -> tuple[str, int, str, str, float]:
    kind, i, seed = place
    case = case_of(kind, i, seed)
    began = time.perf_counter()
    return kind, i, case.label, run(case), time.perf_counter() - began


def asked() -> argparse.Namespace:
    ask = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    ask.add_argument("kinds", nargs="*", default=list(CASES), help=", ".join(CASES))
    ask.add_argument("--times", type=float, default=1.0, help="as many cases as usual")
    ask.add_argument("--first", type=int, default=0, help="only so many of each kind")
    ask.add_argument("--only", type=int, help="the number of one case")
    ask.add_argument("--seed", type=int, default=0)
    ask.add_argument("--jobs", type=int, default=2, help="cases at once")
    return ask.parse_args()


def main() -> int:
    said = asked()
    for module in (*LOADED, *(place.partition(":")[0] for place, _ in COMMANDS.values())):
        import_module(module)
    numbers = {kind: said.first or round(CASES[kind] * said.times) for kind in said.kinds}
    places = [(k, i, said.seed) for k, n in numbers.items() for i in range(n)]
    if said.only is not None:
        places = [(k, said.only, said.seed) for k in said.kinds]
    (campaign_base if {"databases", "disks"} & {*said.kinds} else base)()
    if "caches" in said.kinds:  # before the processes of the cases are forked
        _ = base().small_cache, said.first or base().cache
    ran, failed, seconds = Counter(), Counter(), Counter()
    with mp.get_context("fork").Pool(said.jobs) as pool:
        for kind, i, label, problem, took in pool.imap_unordered(_timed, places):
            ran[kind] += 1
            seconds[kind] += took
            if ran.total() % 50 == 0:
                print(f"{ran.total()} of {len(places)}", file=sys.stderr, flush=True)
            if problem:
                failed[kind] += 1
                print(
                    f"FAILED {kind} --only {i} --seed {said.seed}: {problem}\n    {label[:300]}",
                    flush=True,
                )
    for kind, n in ran.items():
        print(f"{kind:<14}{n:>6} cases {failed[kind]:>5} failed {seconds[kind]:>8.0f} s")
    print(f"{'all':<14}{ran.total():>6} cases {failed.total():>5} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
