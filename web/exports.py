"""A run to take along: its folder as a zip, its telemetry as CSV."""

from __future__ import annotations

import csv
import io
import zipfile
from pathlib import Path

from quadsim.record.run import COLUMNS, Run


def zipped(folder: Path) -> bytes:
    """The run folder as it lies on the disk."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(p for p in folder.iterdir() if p.is_file()):
            archive.write(path, f"{folder.name}/{path.name}")
    return data.getvalue()


def telemetry_csv(run: Run) -> bytes:
    """One row a control step; the head names column and unit, `px [m]`."""
    text = io.StringIO(newline="")
    out = csv.writer(text)
    out.writerow([f"{name} [{unit}]" for name, unit in COLUMNS.items()])
    out.writerows(zip(*(run.telemetry[name].tolist() for name in COLUMNS), strict=True))
    return text.getvalue().encode()
