"""CampaignReports: the campaigns beside the folder of runs, and the reports of `race compare`.

A report has the tables and the figure of one comparison; a campaign's file has all its flights,
shown as by `race results`.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import msgspec

from quadsim.campaign.document import Document, Heading
from quadsim.campaign.flights.results import group_blocks, stored
from quadsim.campaign.run.store import is_campaign
from quadsim.files.arrays import read_bytes
from quadsim.files.links import is_within

# The folder of campaigns beside the folder of runs, as made by `race compare`
CAMPAIGNS = "campaigns"
SUFFIX = ".sqlite"
BLOCKS = ".json"  # the blocks of a report
PNG = b"\x89PNG\r\n\x1a\n"
# Largest report and largest figure that are shown [bytes]
LARGEST_TEXT = 1_000_000
LARGEST_FIGURE = 8_000_000
# Number of the latest reports in the list
MOST = 200


class ReportRow(msgspec.Struct, frozen=True):
    """A report or a campaign in the list."""

    # identifier for the page
    name: str
    # local time of writing
    when: str
    # the file of the campaign
    campaign: str
    # the name of the report; empty for the file itself
    title: str


class Report(NamedTuple):
    """A stored report, or a campaign's table."""

    document: Document
    # PNG as a data URI; empty: there is none
    figure: str


class CampaignReports:
    """The reports of campaigns, for use by one thread.

    The campaigns lie in `campaigns/` beside the folder of runs, or directly beside it: NAME.sqlite,
    with the reports in NAME.report/.

    Args:
        root: the folder of runs.

    Attributes:
        rows: the reports, the latest first.
    """

    def __init__(self, root: str):
        self.rows: tuple[ReportRow, ...] = ()
        self._root = root
        self._beside = Path(root).resolve().parent
        self._paths: dict[str, Path] = {}

    def refresh(self) -> None:
        """Update the list of reports."""
        found = sorted(self._found(), reverse=True)[:MOST]
        self._paths = {path.relative_to(self._beside).as_posix(): path for _, path in found}
        self.rows = tuple(
            ReportRow(
                name=name,
                when=f"{datetime.fromtimestamp(written):%Y-%m-%d %H:%M:%S}",
                campaign=_campaign_of(path),
                title="" if path.suffix == SUFFIX else path.stem,
            )
            for (written, _), (name, path) in zip(found, self._paths.items(), strict=True)
        )

    def read(self, name: str) -> Report:
        """Read a report.

        Raises:
            ValueError, RunError: there is no report of this name, or it cannot be read.
        """
        path = self._paths.get(name)
        if path is None:
            raise ValueError("expected a report of the list; it may have been removed")
        if not is_within(path, _folder_of(path)):
            raise ValueError("expected a report of the list, got a link to another place")
        if path.suffix == SUFFIX:
            return Report(self._table(path), "")
        try:
            document = msgspec.json.decode(
                read_bytes(path, "a report", LARGEST_TEXT), type=Document
            )
        except msgspec.MsgspecError as error:
            raise ValueError(f"{path.name}: expected a report of race compare: {error}") from None
        picture = path.with_suffix(".png")
        figure = ""
        if picture.is_file() and is_within(picture, path.parent):
            data = read_bytes(picture, "the figure of a report", LARGEST_FIGURE)
            if data.startswith(PNG):
                figure = f"data:image/png;base64,{b64encode(data).decode()}"
        return Report(document, figure)

    def _table(self, path: Path) -> Document:
        """Return the table of all flights of a campaign. Raises RunError."""
        groups = stored([str(path)], self._root)
        return Document((Heading(path.name), *group_blocks(groups)))

    def _found(self) -> Iterator[tuple[float, Path]]:
        """Yield each report with its time of writing [s since 1970]."""
        for folder in (self._beside / CAMPAIGNS, self._beside):
            for path in folder.glob(f"*.report/*{BLOCKS}"):
                if path.is_file() and path.name.isprintable() and is_within(path, folder):
                    yield path.stat().st_mtime, path
            for path in folder.glob(f"*{SUFFIX}"):
                if not (path.is_file() and path.name.isprintable() and is_within(path, folder)):
                    continue
                if is_campaign(path):
                    yield path.stat().st_mtime, path


def _folder_of(path: Path) -> Path:
    """Return the folder of campaigns that a report or a campaign's file lies in."""
    return path.parent if path.suffix == SUFFIX else path.parent.parent


def _campaign_of(path: Path) -> str:
    """Return the name of the campaign's file for a report or the file itself."""
    if path.suffix == SUFFIX:
        return path.name
    return path.parent.name.removesuffix(".report") + SUFFIX
