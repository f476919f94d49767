"""Print how fast weak rotors are found, and how often a sound one is taken for a weak one.

.venv/bin/python docs/learning_speed.py [SEEDS]

Each seed is one randomized lap of split_s_swift, as in faults.md. A share is found when it is
within 0.02 of the true one and stays there for 0.1 s. Some half an hour with 30 seeds on one core.
"""

from __future__ import annotations

import sys

import numpy as np

import quadsim
from quadsim.physics.faults import RotorFault, parse_fault
from quadsim.record.run import SHARES

FAULTS = ("rotor=.9", "rotor=.8", "rotor=.7", "rotor=.5")
SENSING = {"true state": None, "vio": "vio"}
WITHIN = 0.02  # of the true share
HELD = 10  # control periods for which it stays there


def main() -> None:
    """Fly, and print a table in Markdown for each kind of sensing."""
    seeds = range(int(sys.argv[1]) if len(sys.argv) > 1 else 30)
    print(
        "| sensing | fault | found | median [s] | slowest [s] |\n| --- | --- | ---: | ---: | ---: |"
    )
    for sensing in SENSING:
        for fault in FAULTS:
            times = np.array([time_until_found(sensing, fault, seed) for seed in seeds])
            found = times[np.isfinite(times)]
            row = (f"{len(found)} of {len(times)}", f"{np.median(found):.2f}", f"{max(found):.2f}")
            print(f"| {sensing} | {fault} |", " | ".join(row), "|", flush=True)
    for sensing in SENSING:
        errors = np.array([largest_error(sensing, seed) for seed in seeds])
        alarms = int(np.sum(errors > WITHIN))
        print(
            f"sound, {sensing}: {alarms} of {len(errors)} flights have a share outside 1 ± {WITHIN}"
        )
        print(
            f"sound, {sensing}: largest errors {np.sort(errors)[-3:].round(3).tolist()}", flush=True
        )


def flown(sensing: str, seed: int, fault: str | None) -> quadsim.Run:
    """Return one lap of a seed."""
    return quadsim.fly(
        "split_s_swift",
        laps=1,
        randomize=1,
        samples=512,
        seed=seed,
        sensing=SENSING[sensing],
        fault=fault,
    )


def time_until_found(sensing: str, asked: str, seed: int) -> float:
    """Return the time from a rotor's fault until its share is found, infinite if it is not [s]."""
    run = flown(sensing, seed, asked)
    [drawn] = run.spec["drawn_faults"]
    fault = parse_fault(drawn)
    assert isinstance(fault, RotorFault)
    assert fault.rotor
    assert fault.window.start is not None
    flown_after = run.telemetry["t"] > fault.window.start
    t = run.telemetry["t"][flown_after] - fault.window.start
    error = run.telemetry[SHARES[fault.rotor - 1]][flown_after] - fault.factor
    held = np.convolve(np.abs(error) < WITHIN, np.ones(HELD), "valid") >= HELD
    return float(t[np.argmax(held)]) if held.any() else np.inf


def largest_error(sensing: str, seed: int) -> float:
    """Return the largest difference of a sound rotor's share from 1."""
    run = flown(sensing, seed, None)
    return float(max(np.abs(run.telemetry[name] - 1.0).max() for name in SHARES))


if __name__ == "__main__":
    main()
