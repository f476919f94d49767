"""`race check`: read files as a flight would, and say what is in them or what is wrong."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import yaml
from rich.markup import escape
from tyro.conf import FlagCreatePairsOff, Positional, arg

from quadsim.app.console import complain, emit, emit_json
from quadsim.app.flags import UsageError
from quadsim.course import COURSES, course_names, parse_course
from quadsim.files.data_files import locate, read_text
from quadsim.files.strict_yaml import FileError, parse
from quadsim.files.yaml_words import did_you_mean
from quadsim.vehicle import GRAVITY, VEHICLES, parse_vehicle, vehicle_names


@dataclass(frozen=True)
class Check:
    """Check course, vehicle and preset files. Exit code 2 if any of them cannot be used.

    race check mine.yaml
    """

    files: Annotated[tuple[str, ...], Positional, arg(metavar="FILE")]  # course, vehicle or preset, or a name of one
    json: FlagCreatePairsOff[bool] = False  # one JSON list instead of lines

    def run(self) -> int:
        if not self.files:
            raise UsageError("expected one FILE or more, got none")
        results = [examine(name) for name in self.files]
        if self.json:
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
    """What kind of file it is, told by a key that only that kind has, and what it holds. Raises FileError."""
    root = parse(text, file).root
    keys = {key.value for key, _ in root.value} if isinstance(root, yaml.MappingNode) else set()
    if keys & {"mass", "inertia", "rate_tau"}:
        v = parse_vehicle(text, file)
        return "vehicle", f"{v.mass:g} kg, thrust-to-weight {v.thrust_max / GRAVITY:.2f}"
    if "base" in keys:
        from quadsim.app.preset_file import parse_planner

        planner = parse_planner(text, file, "colored")
        return "preset", f"{planner.mppi.samples} samples, horizon {planner.mppi.horizon}"
    c = parse_course(text, file)
    laps = f"loop, {c.laps} laps" if c.loop else "open"
    return "course", f"{len(c.gates)} gates, {c.lap_length:.1f} m, {laps}"


def _find(name: str) -> Path:
    """A path as it stands, or the file of a course or vehicle that comes with the project."""
    known = {
        **dict.fromkeys(vehicle_names(), (VEHICLES, "vehicle")),
        **dict.fromkeys(course_names(), (COURSES, "course")),
    }
    if name in known:
        return locate(name, *known[name])
    if Path(name).exists() or "." in name or "/" in name:
        return Path(name)
    raise FileError(f"{name}: no such file, course or vehicle: {did_you_mean(name, known)}")


def _say(result: dict) -> None:
    if result["ok"]:
        emit(f"{escape(result['file'])}: [green]ok[/], {result['kind']}: {result['summary']}")
    else:
        complain(result["error"])
        if result["excerpt"]:
            complain(result["excerpt"])
