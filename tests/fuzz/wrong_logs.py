"""Logs with a mistake of a user: refused with one line, or fitted right within the intervals."""

from __future__ import annotations

import random
from functools import partial

from tests.fuzz.harness import Case
from tests.identify.mistakes import MISTAKES, verdict

VEHICLES = 1000


def wrong_logs(rng: random.Random) -> Case:
    """Return the fit of a log with a mistake."""
    seed = rng.randrange(VEHICLES)
    mistake = rng.choice(sorted(MISTAKES))
    return Case("wrong_logs", f"{mistake}, vehicle {seed}", (), call=partial(_fit, seed, mistake))


def _fit(seed: int, mistake: str) -> int:
    """Fit the log. Return 0 if the numbers are right, 1 if it is refused."""
    end = verdict(seed, mistake)
    assert "\n" not in end, end
    assert not end.startswith("WRONG"), end
    return 1 if end.startswith("refused") else 0
