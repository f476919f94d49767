"""Fly the experiments of docs/results/experiments.yaml and write the CSV files of each.

    make results                        those that the present commit has not flown: hours
    make results NAMES="swift song"     these alone
    python -m docs.results.fly --list   names, minutes and what has been flown

A campaign that is interrupted goes on where it stopped: its attempts lie in runs/results/.
"""

from __future__ import annotations

import argparse
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from docs.results.experiments import (
    Experiment,
    Flown,
    csv_file,
    experiments,
    flights_file,
    read,
    write,
    write_file,
)
from docs.results.flights import flights, has_flights, number, run_campaign, run_json
from quadsim.campaign.flights.stats import FEWEST_PAIRS

ROOT = Path(__file__).parents[2]
RUNS = Path("runs/results")
COMMIT_DIGITS = 8
PAPER = ["race", "paper"]  # whose runs are kept by commit, as it does not know who flew them


def main() -> int:
    """Fly what is asked for; return the exit status."""
    known = experiments()
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(known)}")
    parser.add_argument("--list", action="store_true", help="list the experiments and fly none")
    parser.add_argument("--jobs", type=int, help="attempts at once; default: one for each core")
    given = parser.parse_args()
    unknown = [name for name in given.names if name not in known]
    if unknown:
        parser.error(f"{unknown[0]!r}: expected one of {', '.join(known)}")
    if given.list:
        print(*_listed(known), sep="\n")
        return 0
    chosen = given.names or [name for name in known if not _is_present(name)]
    failed = [name for name in chosen if not _fly(name, known[name], given.jobs)]
    if failed:
        print(f"not complete: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


def _listed(known: Mapping[str, Experiment]) -> Iterable[str]:
    for name, experiment in known.items():
        flown = f"flown at {read(name).commit}" if csv_file(name).exists() else "not flown"
        yield f"{name:20} {experiment.minutes:4} min  {flown:24} {experiment.needs}"


def _commit() -> str:
    told = subprocess.run(
        ["git", "rev-parse", f"--short={COMMIT_DIGITS}", "HEAD"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return told.stdout.strip()


def _is_present(name: str) -> bool:
    """Return whether the present commit has flown an experiment."""
    return csv_file(name).exists() and read(name).commit == _commit()


def _fly(name: str, experiment: Experiment, jobs: int | None) -> bool:
    """Fly an experiment and write its rows; return whether it is complete."""
    print(f"{name}: {experiment.command}", file=sys.stderr)
    words = shlex.split(experiment.command)
    if jobs is not None and words[:2] != PAPER:
        words += ["--jobs", str(jobs)]
    campaign = _campaign(name, words)
    if words[:2] == PAPER:
        found = run_json([*words, "--runs-dir", str(RUNS / _commit())])
    else:
        found = run_campaign(words, campaign, RUNS / name)
    if found is None:
        return False
    rows = list(rows_of(found))
    stats = [*found.get("variants", ()), *(point["stats"] for point in found.get("points", ()))]
    commits = {commit[:COMMIT_DIGITS] for one in stats for commit in one.get("commits", ())}
    flown = Flown(
        command=experiment.command,
        commit=" ".join(sorted(commits)) or _commit(),
        date=f"{datetime.now(UTC):%Y-%m-%d}",
        machine=_machine(),
        rows=rows,
    )
    print(write(name, flown), file=sys.stderr)
    if has_flights(words):
        rows = [flight._asdict() for flight in flights(campaign, experiment.command)]
        file = write_file(flights_file(name), replace(flown, rows=rows))
        print(file, file=sys.stderr)
    return True


def _campaign(name: str, words: Sequence[str]) -> Path:
    """Return the file where the flights of a command are stored.

    Experiments whose single flights are read have a file each; the others share their flights.
    """
    if has_flights(words):
        return RUNS / f"{name}.sqlite"
    return RUNS / ("heats.sqlite" if "compare-heats" in words else "flights.sqlite")


def _machine() -> str:
    """Return the number of cores, and the processor by its name."""
    names = [
        line.split(":", 1)[1].strip()
        for line in Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    return f"{os.cpu_count()} cores, {names[0] if names else platform.machine()}"


def rows_of(found: Mapping[str, Any]) -> Iterable[dict[str, str]]:
    """Return the rows of the JSON object that a command has printed."""
    if "cells" in found:
        return _table2(found)
    if "points" in found:
        return _sweep(found)
    if "settings" in found:
        return _heats(found)
    return _flights(found) if "pairs" in found else _paper(found)


def _table2(found: Mapping[str, Any]) -> Iterable[dict[str, str]]:
    """Yield the costs of each sampler of `race paper table2`, at one sigma beside the other."""
    rows: dict[str, dict[str, str]] = {}
    for cell in found["cells"]:
        row = rows.setdefault(cell["sampler"], {"variant": cell["sampler"]})
        numbers = "runs", "mean", "sd", "paper_mean", "paper_sd"
        row |= {f"{key}_{cell['sigma']:g}": number(cell[key]) for key in numbers}
    return rows.values()


def _paper(found: Mapping[str, Any]) -> Iterable[dict[str, str]]:
    """Yield the numbers of each sampler of Table I, beside those of the paper."""
    for one in found["variants"]:
        row = {"variant": one["sampler"], "attempts": str(one["attempts"])}
        row |= {"finished": str(one["finished"])}
        row |= _share("finished", (one["success_low"], one["success_high"]))
        row |= {f"race_{key}": number(one[key]) for key in ("mean", "sd", "min")}
        paper = "paper_mean", "paper_sd", "paper_min", "paper_valid", "paper_attempts"
        others = "thrust_tv", "high_frequency_fraction", "mean_legs"
        yield row | {key: number(one.get(key)) for key in (*paper, *others)}


def _mean(name: str, value: Mapping[str, Any]) -> dict[str, str]:
    """Return mean and 95 % interval as three columns."""
    return {
        name: number(value["mean"]),
        f"{name}_low": number(value["low"]),
        f"{name}_high": number(value["high"]),
    }


def _share(name: str, interval: Iterable[float]) -> dict[str, str]:
    low, high = interval
    return {f"{name}_low": number(low), f"{name}_high": number(high)}


def _flights(found: Mapping[str, Any]) -> Iterable[dict[str, str]]:
    """Yield the numbers of each variant of `race compare`, beside the first of its course."""
    against = {(pair["course"], pair["a"], pair["b"]): pair for pair in found["pairs"]}
    first: dict[str, str] = {}
    for one in found["variants"]:
        course = one["course"]
        reference = first.setdefault(course, one["name"])
        row = {"course": course, "variant": one["name"]}
        row |= {key: str(one[key]) for key in ("attempts", "finished", "turned_back")}
        row |= _share("finished", one["success_ci"])
        numbers = "race_median", "lap_mean", "lap_sd", "above_limit", "thrust_tv", "rates_tv"
        row |= {key: number(one[key]) for key in numbers}
        row |= _against(against.get((course, reference, one["name"])))
        yield row


def _against(pair: Mapping[str, Any] | None) -> dict[str, str]:
    """Return a variant's lap less that of the first, and the ratio of their thrust variations."""
    unknown = {"mean": None, "low": None, "high": None}
    lap = unknown if pair is None else pair["lap_difference"]
    thrust = unknown if pair is None else pair["thrust_tv_ratio"]
    return _mean("lap_difference", lap) | _mean("thrust_tv_ratio", thrust)


def _sweep(found: Mapping[str, Any]) -> Iterable[dict[str, str]]:
    """Yield the numbers of `race sweep`, the variants at one value below each other."""
    by_value: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for point in found["points"]:
        place = (point["course"], point["setting"], point["value"])
        by_value.setdefault(place, []).append(point)
    for point in (point for of_value in by_value.values() for point in of_value):
        stats = point["stats"]
        rate = stats["crash_rate"]
        row = {key: str(point[key]) for key in ("course", "setting", "value", "variant")}
        row |= {key: str(stats[key]) for key in ("attempts", "finished")}
        row |= _share("finished", stats["success_ci"])
        row |= {"crashes": str(rate["crashes"]), "gates_passed": str(rate["passed"])}
        row |= _mean("crash_rate", rate | {"mean": rate["per_100"]})
        row |= {"race_median": number(stats["race_median"])}
        yield row | _mean("lap_change", _lap_change(point["change"]))


def _lap_change(change: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return the lap at a value less that at the first; few pairs have no interval."""
    if change is None:
        return {"mean": None, "low": None, "high": None}
    found = change["lap_difference"]
    return found if found["n"] >= FEWEST_PAIRS else found | {"low": None, "high": None}


def _heats(found: Mapping[str, Any]) -> Iterable[dict[str, str]]:
    """Yield the numbers of each variant of `race compare-heats`."""
    for name, one in found["settings"].items():
        row = {"variant": name}
        row |= {key: str(one[key]) for key in ("races", "flights", "finished", "contacts")}
        row |= {"with_contact": str(one["with_contact"])}
        row |= _share("finished", one["finished_ci"]) | _share("with_contact", one["contact_ci"])
        yield row | _mean("race", one["race"]) | _mean("overtakes", one["overtakes"])


if __name__ == "__main__":
    sys.exit(main())
