"""The flags and the reports that the commands of campaigns share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape

from quadsim.campaign.document import Documented
from quadsim.cli.flags import Help, Switch
from quadsim.console import emit, emit_json
from quadsim.record.whole_files import expect_file, try_writing

CAMPAIGN = "campaigns/race.sqlite"
VARIANTS = "gaussian,colored"
ATTEMPTS = 10
Campaign = Annotated[str, Help("FILE.sqlite where what has been flown is kept")]
Jobs = Annotated[
    Annotated[int, Meta(ge=1)] | None, Help("flights at once; default: one for each core")
]
ThisCommit = Annotated[bool, Switch("count only flights of this commit")]
ReportFolder = Annotated[
    str | None, Help("folder of the report and its figures; default: beside the campaign")
]
Scheduler = Annotated[
    str | None,
    Help(
        "tcp://HOST:PORT of a Dask cluster, or slurm: --jobs jobs of Slurm; default: processes of "
        "this machine"
    ),
]


def report_folder(campaign: Path, out: str | None) -> Path:
    """Return the folder of a campaign's reports, before anything flies.

    Args:
        campaign: the file of the campaign.
        out: the folder that the user has given; None: beside the campaign.

    Raises:
        RunError: the campaign is no file, or the folder cannot be written.
    """
    expect_file(campaign)
    folder = Path(out) if out else campaign.with_name(f"{campaign.stem}.report")
    try_writing(folder)
    return folder


def show_and_save(found: Documented, folder: Path, stem: str, campaign: str, as_json: bool) -> None:
    """Print a result, and write its report.

    Args:
        found: the result.
        folder: folder of the report.
        stem: name of its files without the ending.
        campaign: the file of the campaign.
        as_json: whether one JSON value is printed in place of tables.

    Raises:
        RunError: the report cannot be written.
    """
    # Results are printed first, as drawing may take some seconds.
    if as_json:
        emit_json(found.as_json() | {"campaign": campaign})
    else:
        emit(*found.document().renderables())
    files = found.save(folder, stem)
    if not as_json:
        emit("", *(f"[dim]{escape(str(file))}[/]" for file in files))
