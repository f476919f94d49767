"""`make fuzz`: run seeded cases of each kind, until one of the kind fails.

Hypothesis draws the cases. It looks for the smallest case that fails, which is printed; the same
seed finds it again. The exit code is 1 if a case failed.
"""

from __future__ import annotations

import argparse
import multiprocessing as mp
import random
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import NamedTuple

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.errors import Flaky
from hypothesis.strategies import randoms

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
from tests.fuzz.mavlink_clients import mavlink_clients
from tests.fuzz.own_parts import own_parts
from tests.fuzz.page_messages import page_messages
from tests.fuzz.pilots import pilots
from tests.fuzz.racing_envs import racing_envs
from tests.fuzz.runs import runs
from tests.fuzz.solutions import solutions
from tests.fuzz.trees import trees
from tests.fuzz.wrong_logs import wrong_logs
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
    "mavlink_clients": Kind(mavlink_clients, 200),
    "wrong_logs": Kind(wrong_logs, 60),
    "trees": Kind(trees, 100),
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


class Search(NamedTuple):
    """The cases of one kind that are run."""

    kind: str
    cases: int
    seed: int


class Result(NamedTuple):
    """The result of a search for a failing case."""

    kind: str
    cases: int  # that have run
    failure: str  # the smallest case that fails; empty if none does
    seconds: float


def searched(search: Search) -> Result:
    """Run cases until one fails, then look for the smallest case that fails."""
    began = time.perf_counter()
    failures: list[str] = []
    ran = 0

    @seed(f"{search.seed} {search.kind}")
    @settings(
        max_examples=search.cases,
        database=None,
        deadline=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    @given(randoms(use_true_random=False))
    def holds(rng: random.Random) -> None:
        nonlocal ran
        ran += not failures
        case = KINDS[search.kind].make(rng)
        problem = run(case)
        if problem:
            failures.append(f"{problem}\n    {case.label[:1000]}")
            raise AssertionError(problem)

    # The last failure is the smallest. Flaky: it failed once, and not again
    with suppress(AssertionError, Flaky):
        holds()
    failure = failures[-1] if failures else ""
    return Result(search.kind, ran, failure, time.perf_counter() - began)


def arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("kinds", nargs="*", default=list(KINDS), help=", ".join(KINDS))
    parser.add_argument("--cases", type=int, help="number of cases of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2, help="kinds at once")
    return parser.parse_args()


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
    load(args.kinds, few=args.cases is not None)
    searches = [Search(kind, args.cases or KINDS[kind].cases, args.seed) for kind in args.kinds]
    failed = 0
    with mp.get_context("fork").Pool(args.jobs) as pool:
        for result in pool.imap_unordered(searched, searches):
            failed += bool(result.failure)
            print(f"{result.kind:<18}{result.cases:>6} cases {result.seconds:>8.0f} s", flush=True)
            if result.failure:
                print(f"FAILED {result.kind} --seed {args.seed}: {result.failure}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
