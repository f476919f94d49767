"""Draw flights from the files of docs/results/flights/, fly each again, and compare the numbers.

    python -m docs.results.refly                      ten flights: a minute
    python -m docs.results.refly --rows 20 --seed 1   others
    python -m docs.results.refly swift betaflight     flights of these experiments

Each flight is flown by the command of its experiment with its variant and its seed. Outcome, laps
and variations have to agree in every printed digit on a processor with AVX-512 and with PyBullet,
as the files were written. Another processor rounds otherwise, so that a flight takes another
path; there the differences are printed and do not fail. Experiments that need an extra or the
firmware are drawn only if they are named.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from docs.results.experiments import experiments, flights_file, read_file
from docs.results.flights import Flight, alone, flights, run_campaign
from docs.results.machine import has_documented_digits

ROWS = 10


class Drawn(NamedTuple):
    """A flight of a file, and the experiment that it belongs to."""

    experiment: str
    command: str
    flight: Flight


def main(given: Sequence[str] | None = None) -> int:
    """Fly what is drawn; return the exit status."""
    flown = [name for name in experiments() if flights_file(name).exists()]
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(flown)}")
    parser.add_argument("--rows", type=int, default=ROWS, help=f"flights; default: {ROWS}")
    parser.add_argument("--seed", type=int, default=0, help="of the draw; default: 0")
    asked = parser.parse_args(given)
    unknown = [name for name in asked.names if name not in flown]
    if unknown:
        parser.error(f"{unknown[0]!r}: expected one of {', '.join(flown)}")
    names = asked.names or [name for name in flown if not experiments()[name].needs]

    listed = list(_listed(names))
    if not listed:
        parser.error("expected files in docs/results/flights/, which make results writes")
    drawn = random.Random(asked.seed).sample(listed, min(asked.rows, len(listed)))
    differ = [one for one in drawn if not _agrees(one)]
    print(f"{len(drawn) - len(differ)} of {len(drawn)} flights, drawn from {len(listed)}, agree")
    if differ and not has_documented_digits():
        print("differences are expected here: the files need AVX-512 and PyBullet")
        return 0
    return 1 if differ else 0


def _listed(names: Iterable[str]) -> Iterable[Drawn]:
    """Yield all flights of experiments, in the order of their files."""
    for name in names:
        flown = read_file(flights_file(name))
        for row in flown.rows:
            yield Drawn(name, flown.command, Flight(**row))


def _agrees(drawn: Drawn) -> bool:
    """Fly a flight again, print how it compares, and return whether it is the same."""
    there = drawn.flight
    label = f"{drawn.experiment} {there.variant} seed {there.seed}"
    here = _flown(drawn)
    if here == there:
        print(f"{label}: {there.outcome}, {there.laps or 'no lap'}, as in the file", flush=True)
        return True
    if here is None:
        print(f"{label}: not flown, see above", flush=True)
        return False
    for name, expected, got in zip(Flight._fields, there, here, strict=True):
        if expected != got:
            wanted = expected or "none"
            print(f"{label}: {name}: expected {wanted}, got {got or 'none'}", flush=True)
    return False


def _flown(drawn: Drawn) -> Flight | None:
    """Return the flight as it is flown here; None if its command has failed."""
    words = alone(drawn.command, drawn.flight)
    with TemporaryDirectory(prefix="quadsim-") as made:
        campaign = Path(made) / "flights.sqlite"
        found = run_campaign([*words, "--jobs", "1"], campaign, Path(made) / "report")
        if found is None:
            return None
        (flight,) = flights(campaign, drawn.command)
    return flight


if __name__ == "__main__":
    sys.exit(main())
