"""The result of a flight, which the library returns; it can be shown, stored and exported."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quadsim.console import as_text, plain
from quadsim.files.extras import imported
from quadsim.limit.limits import StoredSolution, limit_of, limits_folder
from quadsim.racing.events import Frame
from quadsim.record.archive import RunFolder
from quadsim.record.exchange import telemetry_csv
from quadsim.record.mcap_file import mcap_bytes
from quadsim.record.polynomials import MOST_PIECES, PolynomialPath, run_polynomials
from quadsim.record.run import RecordedRun, columns_of
from quadsim.record.run_format import CSV_COLUMNS, check_spec, event_row
from quadsim.record.whole_files import write_whole
from quadsim.report.report import report
from quadsim.report.run_metrics import RunMetrics, run_metrics
from quadsim.report.run_text import one_line, paragraph

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

# Width of a report that is not printed to a terminal [columns]
COLUMNS = 100


class Run(RecordedRun):
    """A flight: its spec, telemetry and events, and numbers and figures made from them.

    `print(run)` describes it in a few sentences; a notebook shows its path and its numbers.

    Attributes:
        spec: the complete configuration as a JSON dict; `quadsim.fly(run.spec)` repeats the flight.
        telemetry: arrays by the names of columns, with one number for each control step  (frames,).
        events: passes, hits, misses and other events, in order.
        outcome: "finished", "crashed", "stuck", "timeout", "interrupted", or "error" if an error of
            a user's own code ended a flight of a campaign.
        wall: wall-clock numbers: plan_ms with p50 and p95 [ms], and real_time_factor.
        snapshots: the planner's best samples every few control steps; None if there are none.
        measurements: with `record_sensing=True`, measurements and estimates as arrays by name, see
            docs/sensing_files.md; otherwise None.
        fault: the error that ended the flight of a campaign, on one line; "" if there was none.
        learned: rotors whose estimated thrust differs from the nominal one: number, share, time
            [s].

    Examples:
        >>> import quadsim
        >>> run = quadsim.fly("figure8", laps=1, samples=256)
        >>> run.outcome
        'finished'
        >>> run.telemetry["vx"].shape == run.telemetry["t"].shape
        True
        >>> run.metrics.top_speed > 15.0  # [m/s]
        True
        >>> bool(run.to_pandas()["pz"].max() < 10.0)  # [m]
        True
        >>> folder = run.save("flights")
        >>> file = run.export("flight.csv")
    """

    @classmethod
    def of(cls, run: RecordedRun) -> Run:
        """Return a recorded run as an object of this class."""
        return cls(**{field.name: getattr(run, field.name) for field in fields(RecordedRun)})

    @classmethod
    def from_frames(cls, spec: dict[str, Any], frames: Iterable[Frame]) -> Run:
        """Return the run that the frames of a flight make."""
        return cls.of(super().from_frames(spec, frames))

    def __repr__(self) -> str:
        """Return one line: course, outcome, laps, time, controller and vehicle."""
        return plain(f"<Run {one_line(self)}>")

    def __str__(self) -> str:
        """Return a paragraph: outcome, laps, conditions, distance to the limit, chatter."""
        return plain(paragraph(self, self.metrics))

    def _repr_html_(self) -> str:
        """Return HTML for a notebook: the numbers, and the path from above."""
        from quadsim.figures.run_html import run_html  # here: it loads matplotlib

        return run_html(self, self.metrics)

    @property
    def metrics(self) -> RunMetrics:
        """The main numbers of the run: laps, splits, speeds, chatter, limit."""
        return run_metrics(self, self._limit())

    def report(self, columns: int = COLUMNS) -> str:
        """Return the report that `race fly` prints, as plain text.

        Args:
            columns: width to which the tables are fitted, in characters.

        Raises:
            RunError: the run was stored by an older version, and its spec lacks keys of the
                report.
        """
        check_spec(self.spec, "this run")
        return as_text(*report(self, self._limit(), columns), columns=columns)

    def to_pandas(self) -> DataFrame:
        """Return the telemetry as a DataFrame, one row for each control step.

        The index is the time `t` [s]; `.attrs["units"]` has the unit of each column.

        Raises:
            ModuleNotFoundError: pandas is not installed; the message says how to install it.
        """
        pandas = imported("pandas", "pandas", "pandas")
        frame = pandas.DataFrame(self.telemetry).set_index("t")
        frame.attrs["units"] = columns_of(self.spec)
        return frame

    def events_to_pandas(self) -> DataFrame:
        """Return the events as a DataFrame with the columns of events.csv, one row for each event.

        The columns are t [s], kind, gate, lap, left and up from the gate's centre [m], speed [m/s],
        the position x, y and z [m], and obstacle. Gate and obstacle are 0 for events at no gate or
        obstacle.

        Raises:
            ModuleNotFoundError: pandas is not installed; the message says how to install it.
        """
        pandas = imported("pandas", "pandas", "pandas")
        return pandas.DataFrame(map(event_row, self.events), columns=list(CSV_COLUMNS))

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw the run in one figure: path, controls over time, spectrum of the thrust.

        Args:
            path: file to write, with the suffix .png, .svg or .pdf; None writes nothing.

        Returns:
            The matplotlib Figure.
        """
        from quadsim.figures.run_figure import draw  # here: it loads matplotlib
        from quadsim.figures.style import save_figure

        figure = draw(self)
        if path is not None:
            save_figure(figure, Path(path))
        return figure

    def save(self, runs_dir: str | Path = "runs") -> Path:
        """Store the run as `race fly` does, and return its folder.

        The folder has run.json, telemetry.npz and events.csv.

        Args:
            runs_dir: folder of runs, in which the run gets its own folder.

        Returns:
            The run's folder.

        Raises:
            RunError: the run cannot be written.
        """
        with RunFolder.open(runs_dir, self.spec) as folder:
            return folder.save(self)

    def export(self, path: str | Path) -> Path:
        """Write the run to a file for other programs, and return its path.

        Args:
            path: FILE.csv for the telemetry, one row for each control step, or FILE.mcap for poses,
                gates, commands and events, which Foxglove and Rerun play.

        Raises:
            ValueError: the path has another suffix.
            ModuleNotFoundError: packages for .mcap are not installed; the message says how to
                install them.
            RunError: the file cannot be written.
        """
        path = Path(path)
        kind = path.suffix.lower()
        if kind == ".csv":
            data = telemetry_csv([(path.stem, self)])
        elif kind == ".mcap":
            data = mcap_bytes(self)
        else:
            raise ValueError(f"export: expected FILE.csv or FILE.mcap, got {str(path)!r}")
        write_whole(path, data)
        return path

    def polynomials(self, pieces: int = MOST_PIECES) -> PolynomialPath:
        """Return the flown path as pieces of 7th-order polynomials, for a Crazyflie.

        `.save("lap.csv")` writes them in the format of uav_trajectories, and `.largest_error` is
        the largest distance from the flown path [m]. The yaw is the vehicle's heading; if the
        vehicle turns over in flight, its first heading is held.

        Args:
            pieces: the number of pieces, of equal duration; 31 fit into a Crazyflie's memory.

        Raises:
            SettingError: the flight is too short, or `pieces` is below 1 (a ValueError).
        """
        return run_polynomials(self, pieces)

    def _limit(self) -> StoredSolution | None:
        """Return the best known limit of the race, from the project and the run's runs_dir."""
        runs_dir = self.spec["host"].get("runs_dir", "runs")
        return limit_of(self.spec, limits_folder(runs_dir))
