"""Show the measurements of `race bench` as tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.console import RenderableType
from rich.table import Table

from quadsim.bench.cases import QUADROTOR, SWEPT, CaseTime, paper_case
from quadsim.bench.envs import PUBLISHED, EnvsSpeed, RacesSpeed
from quadsim.bench.gates import GatesTime
from quadsim.bench.heats import HeatTime, OthersTime, WorldTime
from quadsim.bench.peers import PeerTime
from quadsim.bench.stages import PartTime
from quadsim.console import plain_table


def case_tables(rows: Sequence[CaseTime], most: int) -> Iterator[RenderableType]:
    """Yield a table of the cases of each system, and a table of the growth of time with size.

    Args:
        rows: measured cases.
        most: number of threads of the cases on all threads.
    """
    for system in dict.fromkeys(row.system for row in rows):
        yield cases_table(system, [row for row in rows if row.system == system])
        yield ""
    yield "ms for a million steps: equal down a column where time grows linearly"
    yield growth_table(rows, most)


def cases_table(system: str, rows: Sequence[CaseTime]) -> Table:
    """Return the cases of one system."""
    heads = (
        f"{system}\nM x T x I",
        "\nsampler",
        "\nthreads",
        "p50\n[ms]",
        "p95\n[ms]",
        "\nsteps/s",
        "of the\npeak [%]",
    )
    table = plain_table(*heads, left=(0, 1), no_wrap=True)
    for row in rows:
        table.add_row(
            _size(row),
            row.sampler,
            str(row.threads),
            f"{row.ms_p50:.2f}",
            f"{row.ms_p95:.2f}",
            f"{row.steps_per_s:.2e}",
            f"{100.0 * row.of_peak:.1f}",
        )
    return table


def growth_table(rows: Sequence[CaseTime], most: int) -> Table:
    """Return ms per million steps by size, on one thread and on all, and their ratio."""
    heads = ("1 thread", f"{most} threads", "ratio") if most > 1 else ("1 thread",)
    columns = [
        f"{sampler if i == 0 else ''}\n{head}" for sampler in SWEPT for i, head in enumerate(heads)
    ]
    table = plain_table("\nM x T x I", *columns, left=(0,), no_wrap=True)
    per_million = {(row.name, row.sampler, row.threads): 1e9 / row.steps_per_s for row in rows}
    sizes = {row.name: row for row in sorted(rows, key=_order)}
    for name, row in sizes.items():
        cells: list[str] = []
        for sampler in SWEPT:
            one = per_million.get((name, sampler, 1))
            every = per_million.get((name, sampler, most))
            ratio = one / every if one and every else None
            numbers = (one, every, ratio)[: len(heads)]
            cells += [f"{number:.2f}" if number else "" for number in numbers]
        table.add_row(_size(row) if row.system == QUADROTOR else row.system, *cells)
    return table


def stages_table(rows: Sequence[PartTime], threads: int) -> Table:
    """Return the parts of an iteration, with a block for each sampler."""
    first = f"{rows[0].name}\none iteration, {threads} threads"
    table = plain_table(first, "\nsampler", "\nms", left=(0, 1), no_wrap=True)
    for row in rows:
        table.add_row(row.part, row.sampler, f"{row.ms:.2f}")
    return table


def peer_lines(rows: Sequence[PeerTime]) -> Iterator[str]:
    """Yield a line for each other library."""
    for row in rows:
        yield (
            f"{row.name}: {row.ms_p50:.1f} ms, {row.ratio:.1f} times ours ({row.ours_ms:.2f} ms);"
            f" costs agree to {row.largest_difference:.1e}"
        )


def others_table(rows: Sequence[OthersTime]) -> Table:
    """Return the times of control steps with other vehicles."""
    heads = (
        "expected of\nthe others",
        "\nothers",
        "p50\n[ms]",
        "least\n[ms]",
        "p50 over that\nalone",
    )
    table = plain_table(*heads, left=(0,), no_wrap=True)
    for row in rows:
        numbers = (f"{row.ms_p50:.2f}", f"{row.ms_least:.2f}", f"{row.ratio:.3f}")
        table.add_row(row.expect, str(row.others), *numbers)
    return table


def worlds_table(rows: Sequence[WorldTime]) -> Table:
    """Return the times of steps of a world of several vehicles."""
    table = plain_table("\nworld", "\nvehicles", "a physics\nstep [us]", left=(0,), no_wrap=True)
    for row in rows:
        table.add_row(row.world, str(row.vehicles), f"{row.us:.0f}")
    return table


def heat_table(rows: Sequence[HeatTime]) -> Table:
    """Return the times of races in one world."""
    heads = (
        "vehicles\nin a race",
        "samples\nof each",
        "a control\nperiod [ms]",
        "of real\ntime",
        "over one step of\nthe whole budget",
    )
    table = plain_table(*heads, no_wrap=True)
    for row in rows:
        numbers = (f"{row.ms:.1f}", f"{row.real_time:.2f}", f"{row.full_steps:.2f}")
        table.add_row(str(row.vehicles), str(row.samples), *numbers)
    return table


def gates_table(rows: Sequence[GatesTime]) -> Table:
    """Return every row relative to the first."""
    heads = (
        "gates",
        "plan p50\n[ms]",
        "least\n[ms]",
        "rest of a\nstep [ms]",
        "wall clock for a\nsecond of flight [s]",
    )
    table = plain_table(*heads, no_wrap=True)
    first = rows[0]
    for row in rows:
        table.add_row(
            str(row.gates),
            _beside(row.plan_ms, first.plan_ms),
            _beside(row.plan_ms_least, first.plan_ms_least),
            _beside(row.rest_ms, first.rest_ms),
            _beside(row.wall_per_s, first.wall_per_s),
        )
    return table


def envs_table(rows: Sequence[EnvsSpeed]) -> Table:
    """Return million steps per second, and the core time per step [ns]."""
    heads = (
        "vehicles",
        "threads",
        "in lanes\n[million/s]",
        "core-ns\na step",
        "in arrays\n[million/s]",
        "core-ns\na step",
    )
    table = plain_table(*heads, no_wrap=True)
    for row in rows:
        table.add_row(
            str(row.vehicles),
            str(row.threads),
            f"{row.lanes / 1e6:.1f}",
            f"{1e9 * row.threads / row.lanes:.0f}",
            f"{row.arrays / 1e6:.1f}",
            f"{1e9 * row.threads / row.arrays:.0f}",
        )
    return table


def races_table(rows: Sequence[RacesSpeed]) -> Table:
    """Return million steps of single racers per second."""
    heads = ("races", "racers", "threads", "in lanes\n[million/s]", "in arrays\n[million/s]")
    table = plain_table(*heads, no_wrap=True)
    for row in rows:
        table.add_row(
            str(row.races),
            str(row.racers),
            str(row.threads),
            f"{row.lanes / 1e6:.1f}",
            f"{row.arrays / 1e6:.1f}",
        )
    return table


def other_simulators(plants: Mapping[str, float]) -> Iterator[str]:
    """Yield a line for each simulator of one vehicle in this run, and for each published figure.

    Args:
        plants: speed by the name of the simulator [steps/s].
    """
    for name, steps in plants.items():
        yield (f"one vehicle, no gates, reward or observation: {name}: {steps / 1e6:.2g} million/s")
    for published in PUBLISHED:
        speed = f"{published.steps_per_s / 1e6:g} million/s"
        yield f"published, not measured here: {published.who}: {speed}"


def _beside(number: float, first: float) -> str:
    """Return a number with its ratio to the first row's number, as text."""
    return f"{number:.2f} ({number / first:.3f})"


def _order(row: CaseTime) -> tuple:
    """Return the sort key of a case: the quadrotor first, by samples, then by horizon."""
    paper = paper_case(QUADROTOR, "gaussian")
    return (
        row.system != QUADROTOR,
        row.horizon != paper.horizon,
        row.samples,
        row.horizon,
    )


def _size(row: CaseTime) -> str:
    """Return the budget of a case as text."""
    return f"{row.samples} x {row.horizon} x {row.iterations}"
