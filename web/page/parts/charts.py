"""Charts of signals over time, gaps over place and spectra, which charts.js draws.

While a page shows signals, it asks for missing frames: the question names the race and the number
of frames that the page has of each competitor, and the answer has the next ones, see
quadsim.web.page.server.questions. The curves that are not over time are a part of the page, of the
time that a visitor watches; pressing a chart moves that time.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta

from quadsim.record.run import SHARES
from quadsim.report.metrics import thrust_psd
from quadsim.web.page.server.link import Link, LinkVisitor, Message
from quadsim.web.page.server.questions import Questions
from quadsim.web.race.competitor import Competitor
from quadsim.web.race.lap_timing import LapTiming, best_lap, lap_of
from quadsim.web.race.limit_race import limit_race
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.standings import Way, gap
from quadsim.web.race.viewing import Viewing

PLACES = 300
FREQUENCIES = np.geomspace(0.4, 50.0, 120)  # [Hz]
FEWEST = 32  # smallest number of frames for a spectrum
PSD_FLOOR = 1e-3  # [1e-3 (m/s^2)^2/Hz] below which nothing is drawn
CHUNK = 3000  # frames of a competitor in one answer
MOST = 64  # largest number of competitors in a request

Count = Annotated[int, Meta(ge=0, le=10**8)]
Curve = list[float]  # a nan is a gap in the line, sent as null


# Curves that are computed of several columns of the telemetry
SPEED = "speed"
WEAKEST = "weakest"


class Signal(NamedTuple):
    """A chart over time: its column of the telemetry, and the column of its command."""

    title: str
    column: str  # or SPEED, WEAKEST
    command: str = ""  # empty: no command


# In the order on the page; initially charts.js draws the first ones.
SIGNALS = (
    Signal("thrust [m/s²]", "a", "a_cmd"),
    Signal("roll rate [rad/s]", "wx", "wx_cmd"),
    Signal("pitch rate [rad/s]", "wy", "wy_cmd"),
    Signal("yaw rate [rad/s]", "wz", "wz_cmd"),
    Signal("speed [m/s]", SPEED),
    Signal("height [m]", "pz"),
    Signal("effective samples", "ess"),
    Signal("temperature", "temperature"),
    Signal("planning time [ms]", "plan_ms"),
    Signal("share of the weakest rotor, learned [1]", WEAKEST),
)
COLUMNS = tuple(name for one in SIGNALS for name in (one.column, one.command) if name)


class AskSignals(Message, tag="ask_signals"):
    """A page that shows signals asks for the frames that it lacks.

    Attributes:
        race: number of the race that the page shows.
        frames: number of the frames that it has of each competitor.
        t: time that it shows [s].
        is_playing: whether this time goes on.
    """

    race: Count
    frames: Annotated[list[Count], Meta(max_length=MOST)]
    t: float = 0.0
    is_playing: bool = False


class Line(msgspec.Struct):
    """The look of a competitor in all charts."""

    name: str
    colour: str
    dash: tuple[int, ...]
    is_recorded: bool


class Frames(msgspec.Struct):
    """Frames of a competitor from number `start` on: columns of the telemetry, and t [s]."""

    start: int
    columns: dict[str, Curve]


class Curves(msgspec.Struct):
    """A chart that is not over time, with a curve for each competitor."""

    title: str
    x_title: str
    tab: str
    x: Curve
    y: list[Curve]
    mark: float  # x of a vertical line
    is_log: bool = False
    # distance of x = 0 along the race [m], if a press moves the replay
    seeks_from: float | None = None


class RaceCurves(msgspec.Struct):
    """The charts of a race that are not over time."""

    race: int
    lines: list[Line]
    charts: list[Curves]


class SignalsAnswer(Message, tag="signals"):
    """The frames of the race that a page lacks."""

    race: int
    t: float
    end: float
    is_playing: bool
    can_seek: bool
    lines: list[Line]
    frames: list[Frames]
    laps: list[float]  # starts and ends of the first competitor's laps [s]
    # in the first answer of a race
    signals: list[Signal] | None = None


def signals_of(link: Link, viewing: Viewing) -> Questions[AskSignals]:
    """Return the questions for signals, of the race that each visitor watches."""

    def answer_of(visitor: LinkVisitor, ask: AskSignals, _: float) -> SignalsAnswer | None:
        s = viewing.seen_by(visitor.number)
        return answer(s, ask) if is_new(s, ask) else None

    return Questions(link, AskSignals, answer_of)


def is_new(s: Snapshot, ask: AskSignals) -> bool:
    """Return whether a page lacks anything of a race that a visitor watches."""
    has_all = ask.frames == [len(entry.t) for entry in s.competitors]
    return (s.race, s.t, s.playing) != (ask.race, ask.t, ask.is_playing) or not has_all


def curves_of(race: int, timings: Sequence[LapTiming]) -> RaceCurves:
    """Return the gaps and the spectra at one time of a race with this number."""
    limit = limit_race(timings[0].entry)
    lines = _lines([one.entry for one in timings])
    return RaceCurves(race, lines, [*_gaps(timings, limit), *_spectra(timings)])


def answer(s: Snapshot, ask: AskSignals) -> SignalsAnswer:
    """Return the frames that a page lacks.

    Args:
        s: the race.
        ask: the question, with the number of the page's frames.
    """
    entries = s.competitors
    is_first = ask.race != s.race or len(ask.frames) != len(entries)
    starts = [0] * len(entries) if is_first else ask.frames
    frames = [_frames(entry, start) for entry, start in zip(entries, starts, strict=True)]
    return SignalsAnswer(
        race=s.race,
        t=s.t,
        end=s.end,
        is_playing=s.playing,
        can_seek=bool(s.race),
        lines=_lines(entries),
        frames=frames,
        laps=entries[0].lap_starts if entries else [],
        signals=list(SIGNALS) if is_first else None,
    )


def _lines(entries: Sequence[Competitor]) -> list[Line]:
    """Return the looks of competitors."""
    return [
        Line(one.name, one.style.colour, one.style.dash, is_recorded=not one.live)
        for one in entries
    ]


def _frames(entry: Competitor, start: int) -> Frames:
    """Return the next frames of a competitor."""
    rows = slice(start, start + CHUNK)
    columns = {"t": _rounded(entry.t[rows], 4)}
    for name in COLUMNS:
        columns[name] = _rounded(_values(entry, name, rows), 3)
    return Frames(min(start, len(entry.t)), columns)


def _values(entry: Competitor, name: str, rows: slice) -> np.ndarray:
    """Return the values of a signal in some frames of a competitor."""
    if name == SPEED:
        return entry.speed(rows)
    if name == WEAKEST:
        return entry.rows(SHARES, rows).min(axis=-1)
    return entry.x[name][rows]


def _rounded(values: np.ndarray, digits: int) -> Curve:
    found: Any = np.round(values, digits).tolist()
    return found


def _gaps(timings: Sequence[LapTiming], limit: Competitor | None) -> list[Curves]:
    """Return the gaps at the same place [s].

    There are up to three charts: the race behind the limit, the race behind the first competitor,
    and this lap behind the best lap so far.
    """
    first = timings[0]
    legs = first.entry.legs
    ways = [Way(s.entry.t[: s.i + 1], s.entry.progress[: s.i + 1]) for s in timings]
    place = np.linspace(0.0, legs.length, PLACES)
    found = []
    references = [(f"gap to {first.entry.name} [s]; above 0: behind", ways[0])]
    if limit is not None:
        title = "behind the limit, the best known race [s]"
        references.insert(0, (title, Way(limit.t, limit.progress)))
    if len(timings) == 1:
        references = references[:-1]
    for title, reference in references:
        y = [_rounded(gap(place, way, reference), 3) for way in ways]
        found.append(
            Curves(title, "place [m]", "Gap", _rounded(place, 2), y, first.place, seeks_from=0.0)
        )
    best = best_lap([s.entry.until(s.t) for s in timings])
    if best is not None:
        begins = float([0.0, *legs.lap_ends][first.lap - 1])
        place = np.linspace(0.0, float(np.diff(legs.lap_ends, prepend=0.0)[-1]), PLACES)
        laps = [lap_of(s.entry, s.lap - 1, s.i) for s in timings]
        y = [_rounded(gap(place, lap, best), 3) for lap in laps]
        title = "this lap behind the best lap so far [s]"
        mark = first.place - begins
        x = _rounded(place, 2)
        found.append(Curves(title, "place in the lap [m]", "Gap", x, y, mark, seeks_from=begins))
    return found


def _spectra(timings: Sequence[LapTiming]) -> list[Curves]:
    """Return the power spectral densities of the commanded thrust so far."""
    corner = timings[0].entry.motor_corner
    y = [_rounded(psd(s.entry.until(s.t), FREQUENCIES), 5) for s in timings]
    title = f"thrust PSD [10⁻³ (m/s²)²/Hz]; dashed: motors' corner {corner:.1f} Hz"
    x = _rounded(FREQUENCIES, 4)
    return [Curves(title, "f [Hz]", "Spectrum", x, y, corner, is_log=True)]


def psd(entry: Competitor, f: np.ndarray) -> np.ndarray:
    """Return the power spectral density of the commanded thrust [1e-3 (m/s^2)^2/Hz].

    Args:
        f: frequencies [Hz]  (n,)

    Returns:
        The density, interpolated between the bins of Welch's estimate, nan beyond.  (n,)
    """
    if len(entry.t) < FEWEST:
        return np.full(len(f), np.nan)
    bins, power = thrust_psd(entry.t, entry.x["a_cmd"])
    curve = np.log(np.maximum(1e3 * power[1:], PSD_FLOOR))
    return np.exp(np.interp(np.log(f), np.log(bins[1:]), curve, left=np.nan, right=np.nan))
