"""Print how flights of preset race through these courses end, as the table of the README.

python -m tests.courses_nasty.outcomes --seeds 3 --threads 1 u_turn_beside tight

Exit code 1 where a flight neither finishes nor is refused with a reason before it begins.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import quadsim

COURSES = sorted(Path(__file__).parent.glob("*.yaml"))


def outcome(path: Path, seed: int, **settings: object) -> str:
    """`refused: ...`, `finished in 7.12 s`, or how else it ended, at which gate."""
    try:
        course = quadsim.load_course(path)
        run = quadsim.fly(path, seed=seed, **settings)
    except ValueError as error:
        return f"refused: {error}"
    where = f"{len(run.gates)} of {len(course.gates) * run.spec['laps']} gates"
    faults = {e.kind for e in run.events} & {"hit", "miss", "wrong_way", "unseen_contact"}
    ended = f"{run.outcome} in {run.duration:.2f} s"
    if run.outcome != "finished":
        ended += f", {where}"
    return ", ".join([ended, *sorted(faults)])


def main() -> int:
    ask = argparse.ArgumentParser(
        prog="python -m tests.courses_nasty.outcomes", description=__doc__
    )
    ask.add_argument("courses", nargs="*", help="names; default: all")
    ask.add_argument("--seeds", type=int, default=3)
    ask.add_argument("--threads", type=int, help="of the planner; default: all")
    options = ask.parse_args()
    paths = [p for p in COURSES if p.stem in options.courses or not options.courses]
    print("| course |", " | ".join(f"seed {seed}" for seed in range(options.seeds)), "|")
    print("|---|", "---|" * options.seeds, sep="", flush=True)
    wrong = 0
    for path in paths:
        ends = [outcome(path, seed, threads=options.threads) for seed in range(options.seeds)]
        wrong += sum(not end.startswith(("finished", "refused")) for end in ends)
        print(f"| `{path.stem}` |", " | ".join(ends), "|", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
