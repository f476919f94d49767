"""What a picture or a page that leaves the browser says of a race: leader, differences, results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.report.metrics import total_variation
from quadsim.report.preset_changes import preset_changes
from quadsim.report.run_text import not_comparable
from quadsim.web.race.competitor import Competitor
from quadsim.web.race.standings import Standing, standings_at
from quadsim.web.state.differences import compared

FEWEST = 20  # smallest number of frames for the chatter


class CompetitorLine(NamedTuple):
    """One competitor in one line."""

    entry: Competitor
    text: str


class Summary(NamedTuple):
    """A race at one time, in words.

    Attributes:
        headline: who leads, and by how much.
        compared: what differs between the competitors; empty for a single one.
        lines: the competitors, the leader first.
    """

    headline: str
    compared: str
    lines: tuple[CompetitorLine, ...]


def summary_at(entries: Sequence[Competitor], t: float) -> Summary:
    """Return a race at t [s] in words.

    Args:
        entries: competitors with a frame each, at least one.
        t: time of the race [s].
    """
    standings = standings_at(entries, t)
    course = entries[0].course.name
    said = standings.headline.words
    return Summary(
        headline=f"{course}, {min(t, max(entry.last_t for entry in entries)):.2f} s: {said}",
        compared=compared([entry.record for entry in entries]),
        lines=tuple(CompetitorLine(one.entry, _line(one, t)) for one in standings.order),
    )


def _line(standing: Standing, t: float) -> str:
    """Return a competitor in one line: laps, end or gap, chatter, seed and changed numbers."""
    entry = standing.entry
    i = entry.at(t)
    laps = " + ".join(f"{lap:.3f}" for lap in entry.laps_until(t))
    parts = [f"laps {laps} s" if laps else "in its first lap"]
    has_ended = entry.outcome is not None and i == len(entry.t) - 1
    if has_ended:
        parts.append(f"{entry.outcome} after {entry.last_t:.2f} s")
    if standing.rank > 1 and np.isfinite(standing.gap) and not standing.is_out:
        parts.append(f"{standing.gap:+.2f} s")
    if i >= FEWEST:
        chatter = total_variation(entry.t[: i + 1], entry.x["a_cmd"][: i + 1])
        parts.append(f"chatter {chatter:.0f} m/s²/s")
    parts.append(f"seed {entry.spec.seed}")
    parts += filter(None, [preset_changes(entry.record), not_comparable(entry.record)])
    return f"{entry.name}: {', '.join(parts)}"
