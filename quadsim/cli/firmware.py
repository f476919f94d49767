"""`race firmware`: what there is of Betaflight on this machine, and its build."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar

from quadsim.cli.flags import Help, Json, settings_as_flags
from quadsim.console import UsageError, emit, emit_json, plain_table, progress_console
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


def firmware(
    action: Annotated[
        Literal["show", "build", "identify"],
        Help(
            "show: what there is. build: fetch the source with pip, compile it and keep it."
            " identify: how a vehicle's body rates and thrust follow their commands behind it"
        ),
    ] = "show",
    /,
    *,
    vehicle: Annotated[
        str | None, Help("for identify: a name or a FILE.yaml; default: the preset's")
    ] = None,
    betaflight: Annotated[
        str | None, Help("for identify: configuration, FILE.txt; default: the vehicle's")
    ] = None,
    json: Json = False,
) -> int:
    """Show or build the flight controller Betaflight, or identify a vehicle behind it.

    `race fly --flight-controller betaflight` flies behind it. The build needs pip, gcc and make,
    and takes a minute or two. The firmware is free software under the GPL-3, and runs in a process
    of its own.

    race firmware build

    race firmware identify --vehicle mine.yaml --betaflight mine.txt
    """
    if action == "identify":
        return _identify(vehicle, betaflight, json)
    for name, value in (("--vehicle", vehicle), ("--betaflight", betaflight)):
        if value is not None:
            raise UsageError(f"{name}: expected none beside {action}, got {value!r}")
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


def _identify(vehicle: str | None, betaflight: str | None, json: bool) -> int:
    """Show the rate loop of a vehicle behind the firmware, as the planner's model has it."""
    # imported here, as show and build need no spec
    from quadsim.spec.identified import identified
    from quadsim.spec.spec import Spec

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


def _record(built: Built | None) -> dict[str, Any]:
    if built is None:
        package = f"{PACKAGE} {PACKAGE_VERSION}"
        return {"built": False, "firmware": FIRMWARE_VERSION, "package": package}
    record = asdict(built) | {"program": str(built.program)}
    return {"built": True, "folder": str(firmware_folder())} | record


def _built(quiet: bool) -> Built:
    """Build the firmware; on a terminal a line shows how far it is."""
    console = progress_console()
    if quiet or not console.is_terminal:
        return build()
    columns = (TextColumn("{task.description}"), BarColumn(24))
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        return build(
            lambda what, share: bar.update(task, description=f"{what:<10}", completed=share)
        )
