"""Lists of courses, vehicles, sensings, competitions, presets and settings.

`race courses`, `vehicles`, `sensings`, `competitions`, `presets` and `settings` print the same
tables.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, overload

from quadsim.config.competition import Competition, competition_names, load_competition
from quadsim.controllers.presets import PRESETS
from quadsim.course import Course, course_names, load_course
from quadsim.sensing import Sensing, load_sensing, sensing_names
from quadsim.sensing.sensing_file import SENSORS
from quadsim.tables.settings_table import setting_rows, shown
from quadsim.vehicle import Vehicle, load_vehicle, vehicle_names

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 120  # columns of a table that is printed from Python
# Columns before the published times, and least columns for the published times
LEFT = 49
TIMES = 12
# Columns of the default of a setting
DEFAULT = 14
# The sampler whose numbers are listed for each preset
SAMPLER = "colored"


@dataclass(frozen=True)
class Listing(Sequence[str]):
    """Names, in the order of their table; `print` shows the table.

    Examples:
        >>> import quadsim
        >>> vehicles = quadsim.vehicles()
        >>> list(vehicles)[:2], "swift" in vehicles
        (['archer', 'cf21b_500'], True)
    """

    names: tuple[str, ...]
    make_table: Callable[[int], Table]  # (columns of the terminal) -> the table

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[str, ...]: ...

    def __getitem__(self, index: int | slice | str) -> str | tuple[str, ...]:
        if isinstance(index, str):
            # Tables can be indexed by name, a list of names cannot
            raise TypeError(f"expected a number, got {index!r}: print() shows the table")
        return self.names[index]

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __str__(self) -> str:
        from rich.console import Console  # imported here, as it takes milliseconds to load

        console = Console(width=WIDTH, color_system=None, highlight=False)
        with console.capture() as text:
            console.print(self.make_table(WIDTH))
        return "\n".join(line.rstrip() for line in text.get().splitlines())

    __repr__ = __str__


def courses() -> Listing:
    """Return the names of the courses that come with the project, as `race courses` lists them.

    Examples:
        >>> import quadsim
        >>> [name for name in quadsim.courses() if name.startswith("split")]
        ['split_s_song', 'split_s_swift']
    """
    known = [load_course(name) for name in course_names()]
    return Listing(course_names(), lambda width: course_table(known, width))


def vehicles() -> Listing:
    """Return the names of the vehicles that come with the project, as `race vehicles` lists them.

    Examples:
        >>> import quadsim
        >>> print(quadsim.vehicles())
                            thrust       rate                 rate  motor
                      mass      to      limit                  lag    lag  drag
        vehicle       [kg]  weight    [rad/s]                  [s]    [s]  [1/s]
        ...
        swift         0.87    4.10    10 10 6       0.05 0.05 0.15  0.033  0.4
        ...
    """
    known = [load_vehicle(name) for name in vehicle_names()]
    return Listing(vehicle_names(), lambda _: vehicle_table(known))


def competitions() -> Listing:
    """Return the names of the competitions, as `race competitions` lists them.

    Examples:
        >>> import quadsim
        >>> list(quadsim.competitions())[:2]
        ['aigp_physical', 'lsy_level0']
    """
    known = [load_competition(name) for name in competition_names()]
    return Listing(competition_names(), lambda _: competition_table(known))


def sensings() -> Listing:
    """Return the names of the sets of sensors, as `race sensings` lists them.

    Examples:
        >>> import quadsim
        >>> list(quadsim.sensings())[-3:]
        ['pixels_network', 'velocity', 'vio']
    """
    known = [load_sensing(name) for name in sensing_names()]
    return Listing(sensing_names(), lambda _: sensing_table(known))


def presets() -> Listing:
    """Return the names of the presets, with some of their numbers for colored sampling.

    Examples:
        >>> import quadsim
        >>> list(quadsim.presets())
        ['paper', 'race', 'race_informed']
    """
    return Listing(tuple(PRESETS), lambda _: preset_table())


def settings() -> Listing:
    """Return the names of all settings of `quadsim.fly`, with unit, range, default and meaning.

    docs/settings.md has the same table.

    Examples:
        >>> import quadsim
        >>> settings = quadsim.settings()
        >>> [name for name in settings if "noise" in name]
        ['first_noise']
    """
    rows = setting_rows()
    return Listing(tuple(row.name for row in rows), lambda _: setting_table())


def course_table(courses: Sequence[Course], width: int) -> Table:
    """Return the table of courses for a terminal of `width` columns."""
    from rich.markup import escape

    from quadsim.console import plain_table

    heads = ("course", "gates", "lap [m]", "laps", "opening", "published times [s]")
    table = plain_table(*heads, left=(0, 5), no_wrap=True)
    table.columns[-1].max_width = max(width - LEFT, TIMES)
    for course in courses:
        times = [f"{p.time:6.3f}  {escape(p.who)}" for p in course.published]
        table.add_row(
            course.name,
            str(len(course.gates)),
            f"{course.lap_length:.1f}",
            str(course.laps) if course.loop else "open",
            " x ".join(f"{size:g}" for size in course.gates[0].opening),
            "\n".join(times) or "[dim]  none[/]",
        )
    return table


def vehicle_table(vehicles: Sequence[Vehicle]) -> Table:
    """Return the table of vehicles."""
    from quadsim.console import plain_table

    heads = (
        "vehicle",
        "mass\n[kg]",
        "thrust\nto\nweight",
        "rate\nlimit\n[rad/s]",
        "rate\nlag\n[s]",
        "motor\nlag\n[s]",
        "drag\n[1/s]",
    )
    table = plain_table(*heads, left=(0, 6), no_wrap=True)
    for vehicle in vehicles:
        table.add_row(
            vehicle.name,
            f"{vehicle.mass:.3g}",
            f"{vehicle.thrust_to_weight:.2f}",
            _axes_text(vehicle.omega_max),
            _axes_text(vehicle.rate_tau),
            f"{vehicle.rotors.motor_tau:g}" if vehicle.rotors else "[dim]none[/]",
            _axes_text(vehicle.drag),
        )
    return table


def sensing_table(sensings: Sequence[Sensing]) -> Table:
    """Return the table of sets of sensors."""
    from quadsim.console import plain_table

    table = plain_table("sensing", "sensors: samples a second [Hz], latency [ms]", left=(0, 1))
    for sensing in sensings:
        table.add_row(sensing.name, _sensors_text(sensing))
    return table


def competition_table(competitions: Sequence[Competition]) -> Table:
    """Return the table of competitions."""
    from quadsim.console import plain_table

    table = plain_table("competition", "course", "what it prescribes", left=range(3))
    table.columns[0].no_wrap = True
    table.columns[1].no_wrap = True
    for one in competitions:
        prescribed = [f"{name} {shown(value)}" for name, value in one.settings.items()]
        table.add_row(one.name, one.course, ", ".join(prescribed))
    return table


def preset_table() -> Table:
    """Return the table of presets."""
    from quadsim.console import plain_table

    names = ("samples", "horizon", "iterations", "dt", "target_ess")
    table = plain_table("preset", "vehicle", *names, "cost", left=(0, 1, 7))
    table.columns[0].no_wrap = True
    for name, planners in PRESETS.items():
        planner = planners[SAMPLER]
        numbers = asdict(planner.mppi)
        numbers_shown = [shown(numbers[number]) for number in names]
        table.add_row(
            name,
            planner.vehicle,
            *numbers_shown,
            type(planner.cost).__name__.removesuffix("Weights"),
        )
    return table


def setting_table() -> Table:
    """Return the table of all settings."""
    from rich.markup import escape

    from quadsim.console import plain_table

    table = plain_table("setting", "default", "meaning [unit]; range", left=range(3))
    table.columns[0].no_wrap = True
    table.columns[1].max_width = DEFAULT
    for row in setting_rows():
        meaning = f"{row.meaning} [{row.unit}]" if row.unit else row.meaning
        meaning = f"{meaning}; {row.range}" if row.range else meaning
        table.add_row(row.name, escape(row.default), escape(meaning))
    return table


def _sensors_text(sensing: Sensing) -> str:
    parts: list[str] = []
    for name in SENSORS:
        config = getattr(sensing, name)
        if config:
            parts.append(f"{name} {config.rate:g}, {1e3 * config.latency:g}")
    return "; ".join(parts) or "none: the true state"


def _axes_text(values: Sequence[float]) -> str:
    """Return numbers of axes as text with two digits, a single number if all are equal."""
    texts = [f"{value:.2g}" for value in values]
    return texts[0] if len(set(texts)) == 1 else " ".join(texts)
