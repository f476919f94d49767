"""The tables of a comparison, and the notes below them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import isfinite

from quadsim.campaign.document import Table
from quadsim.campaign.flights.stats import FEWEST_PAIRS, CorrectedP, PairStats, VariantStats
from quadsim.campaign.run.commits import mixed_commits
from quadsim.record.run import ERROR
from quadsim.statistics import Mean

LEAST_P = 1e-9  # p-values that are shown as numbers
# Most variants of which a table shows all pairs: nine have 36
ALL_PAIRS = 6
# Most seeds that a note lists
MOST_SEEDS = 8


def comparison_tables(
    variants: Sequence[VariantStats], pairs: Sequence[PairStats]
) -> Iterator[Table]:
    """Yield the tables of one course: laps, chatter and pairs.

    Args:
        variants: variants of the course.
        pairs: comparisons of every two of them, or of each with the baseline.
    """
    above_limit = ABOVE if _limit_known(variants) else {}
    yield Table.of(variants, LAPS | above_limit)
    yield Table.of(variants, CHATTER, texts=(0, len(CHATTER) - 1))
    behind_firmware = [v for v in variants if isfinite(v.motor_variation.mean)]
    if behind_firmware:
        yield Table.of(behind_firmware, MOTORS)
    shown = shown_pairs(variants, pairs)
    if shown:
        has_baseline = any(pair.corrected for pair in shown)
        yield Table.of(shown, _against(shown[0].a) if has_baseline else PAIRS)


def shown_pairs(
    variants: Sequence[VariantStats], pairs: Sequence[PairStats]
) -> Sequence[PairStats]:
    """Return the pairs that a table shows; many variants are compared with the first one only.

    Args:
        variants: variants of a course.
        pairs: comparisons of every two of them, or of each with the baseline.
    """
    if len(variants) <= ALL_PAIRS or any(pair.corrected for pair in pairs):
        return pairs
    return [pair for pair in pairs if pair.a == variants[0].name]


def notes(
    variants: Sequence[VariantStats], pairs: Sequence[PairStats], limit: float
) -> Iterator[str]:
    """Yield the remarks on the tables of one course.

    Args:
        variants: variants of the course.
        pairs: comparisons of these variants.
        limit: time limit of a lap [s].
    """
    if any(v.finished < v.attempts for v in variants):
        yield (
            "Laps: of attempts that finished. Penalised: the others count as the time limit, "
            f"{limit:.1f} s a lap."
        )
    if any(v.turned_back for v in variants):
        yield "Turned back: attempts that overshot a gate and returned to it."
    yield from notes_of_faults(variants)
    shown = shown_pairs(variants, pairs)
    yield from _notes_of_pairs(shown, len(pairs))
    known = [p for p in shown if isfinite(p.detectable) and p.lap_difference.n >= FEWEST_PAIRS]
    if known:
        names = [p.b if p.corrected else f"{p.b} - {p.a}" for p in known]
        each = ", ".join(f"{n} {p.detectable:.3f} s" for n, p in zip(names, known, strict=True))
        yield f"Lap differences that these pairs detect with power 80 %: {each}."
    if _limit_known(variants):
        yield (
            "Above the limit: the median race over the best known limit of the same, nominal "
            "vehicle (race limit)."
        )
    yield from mixed_commits({v.name: v.commits for v in variants})


def notes_of_faults(variants: Sequence[VariantStats]) -> Iterator[str]:
    """Yield a line for each error that ended attempts of a variant."""
    for variant in variants:
        for fault, seeds in variant.faults.items():
            named = f"seed{'s' if len(seeds) > 1 else ''} {_listed(seeds)}"
            yield f"Ended by an error: {variant.name}, {named}: {fault}"
    if any(ERROR in variant.crashes for variant in variants):
        yield (
            "Ended at error: an error of your own code. Such attempts count as not finished, and "
            "the next run flies them again."
        )


def _listed(seeds: Sequence[int]) -> str:
    """Return the first seeds as text."""
    shown = ", ".join(map(str, seeds[:MOST_SEEDS]))
    more = len(seeds) - MOST_SEEDS
    return f"{shown} and {more} more" if more > 0 else shown


def _notes_of_pairs(shown: Sequence[PairStats], number: int) -> Iterator[str]:
    """Yield the remarks on the pairs of a course.

    Args:
        shown: the pairs of the table.
        number: the number of all pairs.
    """
    if not shown:
        return
    if shown[0].corrected:
        yield (
            f"p: corrected for {len(shown)} variants against {shown[0].a} (Holm), each measure by "
            "itself. Laps and thrust: paired t-test; finished: exact test. Intervals are not "
            "corrected."
        )
    else:
        yield (
            "Only one finished: seeds that the first, and that the second of the pair alone "
            "finished; p: exact test that they finish alike."
        )
    if len(shown) < number:
        yield (
            f"Pairs: {len(shown)} of {number}, those with {shown[0].a}. All are in the JSON output"
            " and in Comparison.pairs; a baseline corrects p for their number."
        )


def _limit_known(variants: Sequence[VariantStats]) -> bool:
    return any(isfinite(v.above_limit) for v in variants)


def number(value: float, form: str = ".3f") -> str:
    """Return a number as text, a dash for nan."""
    return f"{value:{form}}" if isfinite(value) else "-"


def interval(mean: Mean, form: str) -> str:
    """Return "mean [low, high]" as far as they are known."""
    text = number(mean.mean, form)
    if isfinite(mean.low):
        text += f" [{mean.low:{form}}, {mean.high:{form}}]"
    return text


def paired(mean: Mean, form: str) -> str:
    """Return "mean [low, high]" of pairs, the mean alone for fewer than three."""
    return interval(mean, form) if mean.n >= FEWEST_PAIRS else number(mean.mean, form)


def shown_p(value: float) -> str:
    """Return a p-value as text; very small ones as a bound, as t-tests are inexact there."""
    return f"<{LEAST_P:g}" if value < LEAST_P else number(value, ".3g")


def _corrected(pair: PairStats) -> CorrectedP:
    """Return the corrected p-values of a variant against the baseline."""
    assert pair.corrected is not None
    return pair.corrected


def _only_one(pair: PairStats) -> str:
    return f"{pair.only_b} : {pair.only_a}" if pair.seeds else "-"


def _ends(variant: VariantStats) -> str:
    return ", ".join(f"{n} {where}" for where, n in variant.crashes.items()) or "-"


def success_interval(variant: VariantStats) -> str:
    low, high = variant.success_ci
    return f"{100 * low:.0f}-{100 * high:.0f}"


LAPS: dict[str, Callable[[VariantStats], str]] = {
    "variant": lambda v: v.name,
    "done": lambda v: f"{v.finished}/{v.attempts}",
    "CI\n[%]": success_interval,
    "lap\n[s]": lambda v: number(v.lap_mean),
    "sd\n[s]": lambda v: number(v.lap_sd),
    "best\n[s]": lambda v: number(v.lap_min),
    "race\n[s]": lambda v: number(v.race_median),
    "flying\n[s]": lambda v: number(v.flying_median),
    "penalised\n[s]": lambda v: number(v.penalised_mean),
}
ABOVE: dict[str, Callable[[VariantStats], str]] = {
    "above the\nlimit [%]": lambda v: number(100.0 * v.above_limit, ".1f"),
}
CHATTER: dict[str, Callable[[VariantStats], str]] = {
    "variant": lambda v: v.name,
    "thrust\n[m/s^2/s]": lambda v: number(v.thrust_tv, ".1f"),
    "delivered\n[m/s^2/s]": lambda v: number(v.thrust_tv_delivered, ".1f"),
    "body rates\n[rad/s^2]": lambda v: number(v.rates_tv, ".1f"),
    "plan\n[ms]": lambda v: f"{v.plan_ms:.1f}",
    "turned back": lambda v: str(v.turned_back),
    "ended at": _ends,
}
MOTORS: dict[str, Callable[[VariantStats], str]] = {
    "variant": lambda v: v.name,
    "motor commands [1/s]": lambda v: interval(v.motor_variation, ".1f"),
    "thrust lost [m/s^2]": lambda v: interval(v.thrust_lost, ".2f"),
}
PAIRS: dict[str, Callable[[PairStats], str]] = {
    "pair": lambda p: f"{p.b} - {p.a}",
    "lap difference\n[s]": lambda p: paired(p.lap_difference, "+.3f"),
    "pairs": lambda p: str(p.lap_difference.n),
    "only one\nfinished": _only_one,
    "p": lambda p: shown_p(p.success_p),
    "thrust variation\n[ratio]": lambda p: f"x {paired(p.thrust_tv_ratio, '.2f')}",
}


def _against(baseline: str) -> dict[str, Callable[[PairStats], str]]:
    """Return the columns of variants against a baseline."""
    return {
        f"variant less\n{baseline}": lambda p: p.b,
        "lap difference\n[s]": lambda p: paired(p.lap_difference, "+.3f"),
        "p of\nlaps": lambda p: shown_p(_corrected(p).laps),
        "pairs": lambda p: str(p.lap_difference.n),
        "only one\nfinished": _only_one,
        "p of\nfinished": lambda p: shown_p(_corrected(p).success),
        "thrust variation\n[ratio]": lambda p: f"x {paired(p.thrust_tv_ratio, '.2f')}",
        "p of\nthrust": lambda p: shown_p(_corrected(p).thrust_tv),
    }
