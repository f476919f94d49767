"""`race courses`, `vehicles`, `sensings` and `check`: what there is to fly, and whether a file is
sound."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import yaml
from msgspec import Meta
from rich.markup import escape
from rich.table import Table

from quadsim.cli.flags import Help, Json
from quadsim.console import UsageError, complain, emit, emit_json, plain_table, width
from quadsim.course import Course
from quadsim.files.atomic import replace_file
from quadsim.files.data_files import locate, read_text
from quadsim.files.strict_yaml import FileError, parse
from quadsim.files.yaml_errors import did_you_mean
from quadsim.record.whole_files import expect_writable
from quadsim.sensing.sensing_file import (
    SENSINGS,
    SENSORS,
    load_sensing,
    parse_sensing,
    sensing_names,
)
from quadsim.spec.preset_file import parse_planner
from quadsim.spec.systems import SYSTEMS
from quadsim.vehicle import GRAVITY, VEHICLES, Vehicle, load_vehicle, parse_vehicle, vehicle_names

Number = Annotated[int, Meta(ge=1, le=10_000)]

LEFT = 49  # columns of the terminal before the published times


def courses(
    *,
    generate: Annotated[
        Annotated[int, Meta(ge=1, le=10_000)] | None, Help("write so many random courses instead")
    ] = None,
    seed: Annotated[
        Annotated[int, Meta(ge=0, le=10**9)] | None, Help("random seed of those (default: 0)")
    ] = None,
    out: Annotated[
        str | None, Help("the folder to which they are written (default: random_courses)")
    ] = None,
    json: Json = False,
) -> int:
    """The courses that come with the project. `race fly FILE.yaml` flies any other.

    race courses --generate 10 --seed 1 --out random_courses
    """
    if generate is not None:
        return _generate(generate, seed or 0, Path(out or "random_courses"), json)
    for flag, given in (("--seed", seed), ("--out", out)):
        if given is not None:
            raise UsageError(
                f"{flag}: expected --generate N with it, as it is about random courses"
            )
    known = {name: [entry.load_course(c) for c in entry.courses] for name, entry in SYSTEMS.items()}
    if json:
        flown = known.pop("quadrotor")
        listed = [asdict(c) | {"system": "quadrotor", "lap_length": c.lap_length} for c in flown]
        emit_json(
            listed + [asdict(c) | {"system": name} for name, found in known.items() for c in found]
        )
        return 0
    emit(_course_table(known.pop("quadrotor")), "")
    for name, found in known.items():
        emit(f"for the system {name}: {', '.join(c.name for c in found)}")
    return 0


def vehicles(*, json: Json = False) -> int:
    """The vehicles that come with the project. `race fly --vehicle FILE.yaml` flies any other."""
    known = [load_vehicle(name) for name in vehicle_names()]
    if json:
        emit_json([asdict(v) | {"thrust_to_weight": v.thrust_max / GRAVITY} for v in known])
    else:
        emit(_vehicle_table(known))
    return 0


def sensings(*, json: Json = False) -> int:
    """The sets of sensors that come with the project. `race fly --sensing FILE.yaml` flies with any
    other."""
    known = [load_sensing(name) for name in sensing_names()]
    if json:
        emit_json([asdict(s) for s in known])
        return 0
    table = plain_table("sensing", "sensors: samples a second [Hz], latency [ms]", left=(0, 1))
    for s in known:
        sensors = ((name, getattr(s, name)) for name in SENSORS)
        parts = [
            f"{name} {c.rate:g}, {1e3 * getattr(c, 'latency', 0.0):g}" for name, c in sensors if c
        ]
        table.add_row(s.name, "; ".join(parts) or "none: the true state")
    emit(table)
    return 0


def _generate(number: int, seed: int, folder: Path, json: bool) -> int:
    from quadsim.course.random_courses import random_courses

    found = random_courses(number, seed)
    expect_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{course.name}.yaml" for course in found]
    for file, course in zip(files, found, strict=True):
        replace_file(file, course.text.encode())
    if json:
        emit_json([str(file) for file in files])
    else:
        emit(
            *(
                f"{file}: {len(c.gates)} gates, {c.lap_length:.0f} m"
                for file, c in zip(files, found, strict=True)
            )
        )
    return 0


def check(
    *files: Annotated[str, Help("a course, vehicle, preset or sensing file, or the name of one")],
    json: Json = False,
) -> int:
    """Check course, vehicle, preset and sensing files. Exit code 2 if any of them cannot be used.

    race check mine.yaml
    """
    if not files:
        raise UsageError("expected one FILE or more, got none")
    results = [examine(name) for name in files]
    if json:
        emit_json(results)
    else:
        for result in results:
            _say(result)
    return 0 if all(r["ok"] for r in results) else 2


def examine(name: str) -> dict:
    """file, ok, kind and summary, or error and excerpt."""
    try:
        path = _find(name)
        kind, summary = describe(read_text(path), str(path))
    except FileError as error:
        return {"file": name, "ok": False, "error": str(error), "excerpt": error.excerpt}
    return {"file": str(path), "ok": True, "kind": kind, "summary": summary}


def describe(text: str, file: str) -> tuple[str, str]:
    """What kind of file it is, told by a key that only that kind has, and what it holds. Raises
    FileError."""
    root = parse(text, file).root
    keys = {key.value for key, _ in root.value} if isinstance(root, yaml.MappingNode) else set()
    if keys & {"mass", "inertia", "rate_tau"}:
        v = parse_vehicle(text, file)
        return "vehicle", f"{v.mass:g} kg, thrust-to-weight {v.thrust_max / GRAVITY:.2f}"
    if "base" in keys:
        entry = SYSTEMS["quadrotor"]
        planner = parse_planner(text, file, "colored", entry.presets, entry.control_units)
        try:
            entry.load_vehicle(planner.vehicle)
        except FileError as error:
            raise parse(text, file).error("vehicle", str(error)) from None
        return "preset", f"{planner.mppi.samples} samples, horizon {planner.mppi.horizon}"
    if keys & {"exact", *SENSORS}:
        sensing = parse_sensing(text, file)
        given = [name for name in SENSORS if getattr(sensing, name)]
        return "sensing", ", ".join(given) or "the true state"
    system = next((name for name, entry in SYSTEMS.items() if entry.key in keys), "quadrotor")
    c = SYSTEMS[system].parse_course(text, file)
    if not isinstance(c, Course):
        return "course", f"for the system {system}"
    laps = f"loop, {c.laps} laps" if c.loop else "open"
    others = f", {len(c.obstacles)} obstacles" if c.obstacles else ""
    return "course", f"{len(c.gates)} gates{others}, {c.lap_length:.1f} m, {laps}"


def _find(name: str) -> Path:
    """A path as it stands, or the file of a course, vehicle or sensing that comes with the
    project."""
    known = dict.fromkeys(vehicle_names(), (VEHICLES, "vehicle"))
    known |= dict.fromkeys(sensing_names(), (SENSINGS, "sensing"))
    known |= {c: (entry.folder, "course") for entry in SYSTEMS.values() for c in entry.courses}
    if name in known:
        return locate(name, *known[name])
    if Path(name).exists() or "." in name or "/" in name:
        return Path(name)
    raise FileError(
        f"{name}: no such file, course, vehicle or sensing: {did_you_mean(name, known)}"
    )


def _say(result: dict) -> None:
    if result["ok"]:
        emit(f"{escape(result['file'])}: [green]ok[/], {result['kind']}: {result['summary']}")
    else:
        complain(result["error"])
        if result["excerpt"]:
            complain(result["excerpt"])


def _course_table(courses: list[Course]) -> Table:
    heads = ("course", "gates", "lap [m]", "laps", "opening", "published times [s]")
    table = plain_table(*heads, left=(0, 5), no_wrap=True)
    table.columns[-1].max_width = max(width() - LEFT, 12)
    for c in courses:
        laps = str(c.laps) if c.loop else "open"
        opening = " x ".join(f"{size:g}" for size in c.gates[0].opening)
        times = (
            "\n".join(f"{p.time:6.3f}  {escape(p.who)}" for p in c.published) or "[dim]  none[/]"
        )
        table.add_row(c.name, str(len(c.gates)), f"{c.lap_length:.1f}", laps, opening, times)
    return table


def _vehicle_table(vehicles: list[Vehicle]) -> Table:
    numbers = (
        "mass\n[kg]",
        "thrust/\nweight",
        "rate limit\n[rad/s]",
        "rate lag\n[s]",
        "motor\nlag [s]",
        "drag\n[1/s]",
    )
    table = plain_table("vehicle", *numbers, left=(0, 6), no_wrap=True)
    for v in vehicles:
        motor = f"{v.rotors.tau:g}" if v.rotors else "[dim]none[/]"
        thrust = f"{v.thrust_max / GRAVITY:.2f}"
        table.add_row(
            v.name,
            f"{v.mass:g}",
            thrust,
            _axes(v.rate_max),
            _axes(v.rate_tau),
            motor,
            _axes(v.drag),
        )
    return table


def _axes(values: tuple[float, ...]) -> str:
    return f"{values[0]:g}" if len(set(values)) == 1 else " ".join(f"{v:g}" for v in values)
