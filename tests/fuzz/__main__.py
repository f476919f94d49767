"""`make fuzz`: run seeded cases and count them by kind.

A failure is printed with the arguments that reproduce it. The exit code is 1 if there are any.
"""

from __future__ import annotations

import argparse
import multiprocessing as mp
import random
import sys
import time
from collections import Counter
from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple

from tests.fuzz.base import base, campaign_base
from tests.fuzz.betaflight_texts import betaflight_texts
from tests.fuzz.caches import caches
from tests.fuzz.checkpoints import begun, checkpoints
from tests.fuzz.databases import databases
from tests.fuzz.disks import disks, exports
from tests.fuzz.environments import environments
from tests.fuzz.flags import commands, flags
from tests.fuzz.foreign import foreign
from tests.fuzz.harness import Case, run
from tests.fuzz.own_parts import own_parts
from tests.fuzz.page_messages import page_messages
from tests.fuzz.pilots import pilots
from tests.fuzz.racing_envs import racing_envs
from tests.fuzz.runs import runs
from tests.fuzz.solutions import solutions
from tests.fuzz.yamls import yamls


class Kind(NamedTuple):
    """A kind of damage."""

    make: Callable[[random.Random], Case]
    cases: int  # how many cases `make fuzz` runs


KINDS = {
    "flags": Kind(flags, 300),
    "yamls": Kind(yamls, 300),
    "foreign": Kind(foreign, 200),
    "runs": Kind(runs, 200),
    "caches": Kind(caches, 100),
    "databases": Kind(databases, 150),
    "exports": Kind(exports, 60),
    "disks": Kind(disks, 60),
    "environments": Kind(environments, 60),
    "pilots": Kind(pilots, 100),
    "solutions": Kind(solutions, 60),
    "checkpoints": Kind(checkpoints, 100),
    "racing_envs": Kind(racing_envs, 100),
    "own_parts": Kind(own_parts, 100),
    "page_messages": Kind(page_messages, 100),
    "betaflight_texts": Kind(betaflight_texts, 200),
}
# Modules that are loaded before the processes of the cases are forked.
LOADED = (
    "quadsim.cli.fly",
    "quadsim.controllers.lanes.lanes",
    "pybullet",
    "matplotlib.figure",
    "quadsim.web.page.forms.export",
    "optuna",
)


class Place(NamedTuple):
    """The three numbers on which a case depends, and nothing else."""

    kind: str
    number: int
    seed: int


class Result(NamedTuple):
    """A case that has run."""

    place: Place
    label: str
    problem: str
    seconds: float


def case_of(place: Place) -> Case:
    """Return the case at a place."""
    return KINDS[place.kind].make(random.Random(f"{place.seed} {place.kind} {place.number}"))


def timed(place: Place) -> Result:
    """Run the case at a place."""
    case = case_of(place)
    began = time.perf_counter()
    problem = run(case)
    return Result(place, case.label, problem, time.perf_counter() - began)


def arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("kinds", nargs="*", default=list(KINDS), help=", ".join(KINDS))
    parser.add_argument("--times", type=float, default=1.0, help="multiple of the usual cases")
    parser.add_argument("--first", type=int, default=0, help="number of cases of each kind")
    parser.add_argument("--only", type=int, help="the number of one case")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="cases at once")
    return parser.parse_args()


def chosen(args: argparse.Namespace) -> list[Place]:
    """Return the places of the cases that the command line asks for."""
    if args.only is not None:
        return [Place(kind, args.only, args.seed) for kind in args.kinds]
    numbers = {kind: args.first or round(KINDS[kind].cases * args.times) for kind in args.kinds}
    return [Place(kind, i, args.seed) for kind, n in numbers.items() for i in range(n)]


def load(kinds: list[str], few: bool) -> None:
    """Load every module and make the originals, which the processes of the cases inherit."""
    commands()
    for module in LOADED:
        import_module(module)
    if {"databases", "disks"} & set(kinds):
        campaign_base()
    if "caches" in kinds:
        _ = base().small_cache
        if not few:
            _ = base().cache
    if "checkpoints" in kinds:
        begun()
    base()


def main() -> int:
    """Run the cases. Return the exit code."""
    args = arguments()
    load(args.kinds, few=args.first > 0)
    places = chosen(args)
    ran, failed, seconds = Counter(), Counter(), Counter()
    with mp.get_context("fork").Pool(args.jobs) as pool:
        for result in pool.imap_unordered(timed, places):
            kind = result.place.kind
            ran[kind] += 1
            seconds[kind] += result.seconds
            if ran.total() % 50 == 0:
                print(f"{ran.total()} of {len(places)}", file=sys.stderr, flush=True)
            if result.problem:
                failed[kind] += 1
                where = f"{kind} --only {result.place.number} --seed {result.place.seed}"
                print(f"FAILED {where}: {result.problem}\n    {result.label[:300]}", flush=True)
    for kind, n in ran.items():
        print(f"{kind:<14}{n:>6} cases {failed[kind]:>5} failed {seconds[kind]:>8.0f} s")
    print(f"{'all':<14}{ran.total():>6} cases {failed.total():>5} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
