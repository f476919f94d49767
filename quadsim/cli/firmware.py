"""`race firmware`: what there is of Betaflight on this machine, and its build."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any, Literal

from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar

from quadsim.cli.flags import Help, Json
from quadsim.console import emit, emit_json, progress_console
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
        Literal["show", "build"],
        Help("show: what there is. build: fetch the source with pip, compile it and keep it"),
    ] = "show",
    /,
    *,
    json: Json = False,
) -> int:
    """Show or build the flight controller Betaflight.

    `race fly --flight-controller betaflight` flies behind it. The build needs pip, gcc and make,
    and takes a minute or two. The firmware is free software under the GPL-3, and runs in a process
    of its own.

    race firmware build
    """
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
