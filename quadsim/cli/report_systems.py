"""REPORTS: what the report of a run says about its system, beside what it says of every run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import hypot

from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table

from quadsim.cli.report_tables import chatter_table, incident_table, lap_tables, published_table
from quadsim.console import plain_table
from quadsim.course import Course, parse_course
from quadsim.course.corridor import Corridor, parse_corridor
from quadsim.course.point_goal import parse_point_goal
from quadsim.record.metrics import chatter, cost_terms, splits
from quadsim.record.run import Run, system_of, units_of
from quadsim.record.turning_back import turned_back

Part = RenderableType
# kind of event -> in words
ENDS = {"wall": "touched a wall", "stuck": "got stuck", "timeout": "ran out of time"}


def variation_table(run: Run) -> Table:
    """Of each commanded control."""
    table = plain_table(
        "control, commanded", "total variation", "largest slew", "", left=(0, 3), no_wrap=True
    )
    for name, of in chatter(run)["commanded"].items():
        table.add_row(
            escape(name), f"{of['tv']:.2f}", f"{of['slew_max']:.1f}", f"[dim]{of['unit']}/s[/]"
        )
    return table


@dataclass(frozen=True)
class SystemReport:
    """What a run of one system has reached."""

    results: Callable[[Run, int], Iterator[Part]]  # of a run, for so many columns of the terminal
    # the same as JSON, as far as it is not in every summary
    numbers: Callable[[Run], dict] = lambda run: {}
    progress: Callable[[Run], str] = lambda run: ""  # "3 of 3 laps"
    chatter: Callable[[Run], Part] = variation_table
    comparison: Callable[[Run], Iterator[Part]] = lambda run: iter(())  # with others


def _race(run: Run, columns: int) -> Iterator[Part]:
    yield from lap_tables(run, len(_course(run).gates), columns)
    yield incident_table(run)
    if turns := turned_back(run):
        places = ", ".join(
            f"gate {turn['gate']} (lap {turn['lap']}, {turn['t']:.2f} s)" for turn in turns
        )
        yield f"[yellow]turned back[/] to {places}"


def _course(run: Run) -> Course:
    return parse_course(run.spec["course_text"], run.spec["course"])


def _corridor(run: Run) -> Corridor:
    return parse_corridor(run.spec["course_text"], run.spec["course"])


def _legs(run: Run) -> list[dict]:
    """Of every leg that was driven to its end: time [s], length of the centre line [m], speed there
    [m/s]."""
    times, lengths = (t for lap in splits(run) for t in lap), _corridor(run).lengths
    return [
        {
            "leg": e["gate"],
            "time": t,
            "length": float(length),
            "left": e["offset"][0],
            "speed": e["speed"],
        }
        for e, t, length in zip(run.gates, times, lengths, strict=False)
    ]


def _drive(run: Run, columns: int) -> Iterator[Part]:
    """A table of the legs, and how the drive ended."""
    table = plain_table(
        "leg", "time [s]", "length [m]", "left of the centre [m]", "speed at its end [m/s]"
    )
    for leg in _legs(run):
        numbers = (
            f"{leg['time']:.3f}",
            f"{leg['length']:.1f}",
            f"{leg['left']:+.2f}",
            f"{leg['speed']:.1f}",
        )
        table.add_row(str(leg["leg"]), *numbers)
    yield table if table.row_count else "no leg driven to its end"
    yield _end_of_drive(run)


def _end_of_drive(run: Run) -> str:
    if run.outcome == "finished":
        return "reached the goal"
    last = run.events[-1] if run.events and run.events[-1].kind != "pass" else None
    leg = f"on leg {len(run.gates) + 1}"
    if last is None:
        return f"{run.outcome} {leg}"
    side = "left" if last.offset[0] > 0 else "right"
    where = f"{abs(last.offset[0]):.2f} m {side} of the centre line, at {last.speed:.1f} m/s"
    return f"[red]{ENDS.get(last.kind, last.kind)}[/] {leg}, {where}"


def _point(run: Run) -> dict:
    """The accumulated cost, and the last state: distance to the goal [m], speed [m/s]."""
    goal = parse_point_goal(run.spec["course_text"], run.spec["course"]).goal
    px, py, vx, vy = (run.telemetry[name][-1] for name in units_of(run.spec)[0])
    terms = cost_terms(run)
    reached = {"distance": hypot(px - goal[0], py - goal[1]), "speed": hypot(vx, vy)}
    return {"accumulated_cost": sum(terms.values()), "cost_terms": terms, "end": reached}


def _goal(run: Run, columns: int) -> Iterator[Part]:
    if not len(run.telemetry["t"]):
        return
    numbers = _point(run)
    table = plain_table("", "", "", left=(0, 2), no_wrap=True)
    table.show_header = False
    table.add_row("accumulated quadratic cost", f"{numbers['accumulated_cost']:.1f}")
    for name, term in numbers["cost_terms"].items():
        table.add_row(f"  of it {name}", f"{term:.1f}")
    table.add_row(
        "distance to the goal at the end", f"{numbers['end']['distance']:.3f}", "[dim]m[/]"
    )
    table.add_row("speed at the end", f"{numbers['end']['speed']:.3f}", "[dim]m/s[/]")
    yield table


def _states(run: Run) -> dict[str, dict[str, float]]:
    """The first and the last state, name -> {start, end}."""
    x = {name: run.telemetry[name] for name in units_of(run.spec)[0]}
    return {name: {"start": float(v[0]), "end": float(v[-1])} for name, v in x.items() if len(v)}


def _start_and_end(run: Run, columns: int) -> Iterator[Part]:
    units = units_of(run.spec)[0]
    table = plain_table("state", "at the start", "at the end", "", left=(0, 3), no_wrap=True)
    for name, of in _states(run).items():
        unit = units[name] if units[name] != "1" else ""
        table.add_row(escape(name), f"{of['start']:.3f}", f"{of['end']:.3f}", f"[dim]{unit}[/]")
    yield table


# of a system not in REPORTS
START_AND_END = SystemReport(_start_and_end, lambda run: {"states": _states(run)})
REPORTS = {
    "quadrotor": SystemReport(
        _race,
        progress=lambda run: f"{len(run.laps)} of {run.spec['laps']} laps",
        chatter=chatter_table,
        comparison=lambda run: iter([published_table(run, _course(run))]),
    ),
    "offroad": SystemReport(
        _drive,
        lambda run: {"legs": _legs(run)},
        progress=lambda run: f"{len(run.gates)} of {len(_corridor(run).lengths)} legs",
    ),
    "double_integrator": SystemReport(
        _goal, lambda run: _point(run) if len(run.telemetry["t"]) else {}
    ),
}


def report_of(run: Run) -> SystemReport:
    return REPORTS.get(system_of(run.spec) or "", START_AND_END)
