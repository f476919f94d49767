"""`race courses` and `race vehicles`: what comes with the project."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from rich.markup import escape
from rich.table import Table
from tyro.conf import FlagCreatePairsOff

from quadsim.app.console import emit, emit_json, plain_table, width
from quadsim.course import Course, course_names, load_course
from quadsim.vehicle import GRAVITY, Vehicle, load_vehicle, vehicle_names

LEFT = 49  # columns of the terminal before the published times


@dataclass(frozen=True)
class Courses:
    """The courses that come with the project. `race fly FILE.yaml` flies any other."""

    json: FlagCreatePairsOff[bool] = False  # everything the files say, as one JSON list

    def run(self) -> int:
        courses = [load_course(name) for name in course_names()]
        if self.json:
            emit_json([asdict(c) | {"lap_length": c.lap_length} for c in courses])
        else:
            emit(_course_table(courses))
        return 0


@dataclass(frozen=True)
class Vehicles:
    """The vehicles that come with the project. `race fly --vehicle FILE.yaml` flies any other."""

    json: FlagCreatePairsOff[bool] = False  # everything the files say, as one JSON list

    def run(self) -> int:
        vehicles = [load_vehicle(name) for name in vehicle_names()]
        if self.json:
            emit_json([asdict(v) | {"thrust_to_weight": v.thrust_max / GRAVITY} for v in vehicles])
        else:
            emit(_vehicle_table(vehicles))
        return 0


def _course_table(courses: list[Course]) -> Table:
    heads = ("course", "gates", "lap [m]", "laps", "opening", "published times [s]")
    table = plain_table(*heads, left=(0, 5), no_wrap=True)
    table.columns[-1].max_width = max(width() - LEFT, 12)
    for c in courses:
        laps = str(c.laps) if c.loop else "open"
        opening = " x ".join(f"{size:g}" for size in c.gates[0].opening)
        times = "\n".join(f"{p.time:6.3f}  {escape(p.who)}" for p in c.published) or "[dim]  none[/]"
        table.add_row(c.name, str(len(c.gates)), f"{c.lap_length:.1f}", laps, opening, times)
    return table


def _vehicle_table(vehicles: list[Vehicle]) -> Table:
    numbers = ("mass\n[kg]", "thrust/\nweight", "rate limit\n[rad/s]", "rate lag\n[s]", "motor\nlag [s]", "drag\n[1/s]")
    table = plain_table("vehicle", *numbers, left=(0, 6), no_wrap=True)
    for v in vehicles:
        motor = f"{v.rotors.tau:g}" if v.rotors else "[dim]none[/]"
        thrust = f"{v.thrust_max / GRAVITY:.2f}"
        table.add_row(v.name, f"{v.mass:g}", thrust, _axes(v.rate_max), _axes(v.rate_tau), motor, _axes(v.drag))
    return table


def _axes(values: tuple[float, ...]) -> str:
    return f"{values[0]:g}" if len(set(values)) == 1 else " ".join(f"{v:g}" for v in values)
