"""Command lines: every flag of every command, with values that it may or may not take."""

from __future__ import annotations

import random
import re
from contextlib import redirect_stdout
from functools import cache
from io import StringIO

from quadsim.cli.cli import race
from tests.fuzz.damage import WORDS
from tests.fuzz.harness import Case

TINY = {
    "--samples": "128",
    "--horizon": "20",
    "--iterations": "1",
    "--laps": "1",
    "--timeout": "0.1",
}
COURSES = ("paper_flat", "split_s_swift", "split_s_swfit", "", ".", "no.yaml", "-")
# Values that some flag takes.
GOOD = (
    "gaussian", "colored", "smooth", "race", "paper", "swift", "rigid", "wall", "0.5", "1 1 1 1",
)  # fmt: skip
# Flags whose large values are right, and take long.
LONG = {
    "--timeout", "--laps", "--seconds", "--trials", "--attempts", "--runs", "--samples",
    "--horizon",
}  # fmt: skip
# Commands that would rightly run for long are given a value that they refuse.
REFUSED = {
    "bench": ("--seconds", "0"),
    "web": ("--port", "-1"),
    "paper": ("--runs", "0"),
    "tune": ("--trials", "0"),
    "limit": ("--nodes", "7"),
}
FLIES = ("fly", "compare", "tune", "regress")


@cache
def commands() -> tuple[str, ...]:
    """Return the names of the commands. Loads the modules of all of them."""
    names = re.findall(r"^  ([a-z]+) {2,}", _help(), re.MULTILINE)
    for name in names:
        flags_of(name)
    return tuple(names)


@cache
def flags_of(command: str) -> tuple[str, ...]:
    """Return the flags of a command, by its help, and one that it does not have."""
    known = set(re.findall(r"(?<![\w-])--[a-z][\w.-]*\w", _help(command)))
    return (*sorted(known), "--no-such-flag")


def _help(*argv: str) -> str:
    text = StringIO()
    with redirect_stdout(text):
        race([*argv, "--help"])
    return text.getvalue()


def flags(rng: random.Random) -> Case:
    """Return a case with a command, its arguments, and one to three flags.

    Flights are made short; a command that would rightly run for long gets a flag that it refuses.
    """
    command = rng.choice([*commands(), "fly", "fly", "fly"])
    asked = {}
    known = flags_of(command)
    for name in rng.sample(known, min(rng.choice((1, 1, 2, 3)), len(known))):
        value = rng.choice(WORDS if rng.random() < 0.7 else GOOD)
        asked[name] = "1e9x" if name in LONG and value in ("1e9", "1_000") else value
    asked |= {k: v for k, v in TINY.items() if command in FLIES and k not in asked}
    if command in ("compare", "tune", "regress"):
        # These values start no worker.
        asked["--jobs"] = rng.choice(("0", "-1", "x", ""))
    if command in REFUSED:
        name, value = REFUSED[command]
        asked[name] = value
    words = [command]
    if command == "paper":
        words.append(rng.choice(("table2", "tabel2", *WORDS)))
    elif rng.random() < 0.6:
        words.append(rng.choice(COURSES if command in FLIES else WORDS))
    for name, value in asked.items():
        joined = rng.random() < 0.3
        if joined:
            words.append(f"{name}={value}")
        else:
            words.append(name)
            words += [value] if rng.random() < 0.9 else []
    argv = tuple(word.replace("\x00", "") for word in words)
    return Case("flags", " ".join(map(repr, argv)), argv)
