"""Fit pieces of polynomials to a path, as the high-level commander of a Crazyflie flies them."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, replace
from math import cos, degrees, factorial, radians
from pathlib import Path

import numpy as np

from quadsim.files.values import SettingError
from quadsim.record.run import RecordedRun
from quadsim.record.whole_files import write_whole
from quadsim.rotation import body_axes

AXES = ("x", "y", "z", "yaw")
DEGREE = 7
# The memory of a Crazyflie for trajectories, 4096 bytes, has room for 31 pieces of 132 bytes
MOST_PIECES = 31
# Derivatives that are continuous from piece to piece: up to the jerk, which decides body rates
CONTINUOUS = 3
# Rows of the path for each piece at least, so that they determine its coefficients
ROWS_PER_PIECE = 8
# A vehicle that tilts further has no heading that a polynomial can follow
LARGEST_TILT = radians(80.0)


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialPath:
    """A path as pieces of 7th-order polynomials.

    Position, velocity, acceleration and jerk are continuous from piece to piece.

    Attributes:
        durations: duration of each piece [s]  (pieces,).
        coefficients: of x, y, z [m] and yaw [rad] for the powers 0 to 7 of the time since the
            piece's start  (pieces, 4, 8).
        largest_error: largest distance of the fitted path from the given one [m].
        largest_yaw_error: largest difference of the yaw [rad].
        yaw_held: whether the yaw is constant, because the vehicle turns over in flight and has no
            heading that polynomials can follow.

    Examples:
        >>> import numpy as np
        >>> import quadsim
        >>> t = np.linspace(0.0, 1.0, 100)
        >>> climb = np.column_stack([0.0 * t, 0.0 * t, t**2])
        >>> path = quadsim.fit_polynomials(t, climb, pieces=2)
        >>> path.durations, path.coefficients.shape, path.largest_error < 1e-9
        (array([0.5, 0.5]), (2, 4, 8), True)
    """

    durations: np.ndarray
    coefficients: np.ndarray
    largest_error: float
    largest_yaw_error: float
    yaw_held: bool = False

    def __repr__(self) -> str:
        """Return one line: pieces, duration and errors."""
        return f"<PolynomialPath {self.summary}>"

    @property
    def summary(self) -> str:
        """The number of pieces, the duration and the largest errors."""
        yaw = f"and {degrees(self.largest_yaw_error):.1f} deg of yaw"
        if self.yaw_held:
            yaw = "yaw held, as the vehicle turns over"
        pieces = f"{len(self.durations)} pieces, {self.durations.sum():.2f} s"
        return f"{pieces}, largest error {self.largest_error:.2g} m, {yaw}"

    def csv(self) -> bytes:
        """Return the path in the format of uav_trajectories, a row for each piece."""
        lines = io.StringIO(newline="")
        out = csv.writer(lines)
        out.writerow(["duration", *(f"{axis}^{k}" for axis in AXES for k in range(DEGREE + 1))])
        for duration, of_piece in zip(self.durations, self.coefficients, strict=True):
            out.writerow([f"{number:.10g}" for number in (duration, *of_piece.ravel())])
        return lines.getvalue().encode()

    def save(self, path: str | Path) -> Path:
        """Write the path in the format of uav_trajectories, and return the file's path.

        Raises:
            RunError: the file cannot be written.
        """
        path = Path(path)
        write_whole(path, self.csv())
        return path


def fit_polynomials(
    t: np.ndarray,
    position: np.ndarray,
    yaw: np.ndarray | float = 0.0,
    pieces: int = MOST_PIECES,
) -> PolynomialPath:
    """Fit pieces of 7th-order polynomials of equal duration to a path by least squares.

    Args:
        t: increasing times [s]  (n,).
        position: positions in the world frame [m]  (n, 3).
        yaw: heading about the world's z axis [rad], without jumps  (n,); a number is held.
        pieces: the number of pieces, if the path has at least 8 rows for each, otherwise fewer.

    Returns:
        The fitted path, with its largest errors at the given times.

    Raises:
        SettingError: the times do not increase, the shapes do not fit, or pieces is below 1
            (a ValueError).

    Examples:
        >>> import numpy as np
        >>> import quadsim
        >>> t = np.linspace(0.0, 4.0, 400)
        >>> circle = np.column_stack([np.cos(t), np.sin(t), np.ones_like(t)])
        >>> quadsim.fit_polynomials(t, circle, pieces=4)
        <PolynomialPath 4 pieces, 4.00 s, largest error ... m, and 0.0 deg of yaw>
    """
    # Here, as commands load this module and scipy takes .3 s
    from scipy.interpolate import make_lsq_spline

    times, rows = _checked(t, position, yaw)
    if pieces < 1:
        raise SettingError("pieces", f"expected at least 1, got {pieces}")
    count = max(min(pieces, len(times) // ROWS_PER_PIECE), 1)

    # A spline whose inner knots are repeated so often that derivatives beyond the jerk may jump
    breaks = np.linspace(times[0], times[-1], count + 1)
    inner = np.repeat(breaks[1:-1], DEGREE - CONTINUOUS)
    ends = (np.full(DEGREE + 1, times[0]), np.full(DEGREE + 1, times[-1]))
    spline = make_lsq_spline(times, rows, np.concatenate([ends[0], inner, ends[1]]), DEGREE)

    # The Taylor series at the start of each piece is its polynomial
    series = [spline(breaks[:-1], nu=k) / factorial(k) for k in range(DEGREE + 1)]
    error = spline(times) - rows
    return PolynomialPath(
        durations=np.diff(breaks),
        coefficients=np.stack(series, axis=2),
        largest_error=float(np.linalg.norm(error[:, :3], axis=1).max()),
        largest_yaw_error=float(abs(error[:, 3]).max()),
    )


def _checked(
    t: np.ndarray, position: np.ndarray, yaw: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the times and the rows of position and yaw  (n,), (n, 4). Raises SettingError."""
    times = np.asarray(t, float)
    if times.ndim != 1 or len(times) < ROWS_PER_PIECE or not (np.diff(times) > 0.0).all():
        wanted = f"expected at least {ROWS_PER_PIECE} increasing times"
        raise SettingError("t", f"{wanted}, got an array of shape {times.shape}")
    path = np.asarray(position, float)
    if path.shape != (len(times), 3):
        wanted = f"expected the shape ({len(times)}, 3)"
        raise SettingError("position", f"{wanted}, got {path.shape}")
    heading = np.asarray(yaw, float)
    if heading.shape not in ((), times.shape):
        wanted = f"expected a number or the shape {times.shape}"
        raise SettingError("yaw", f"{wanted}, got {heading.shape}")
    rows = np.column_stack([path, np.broadcast_to(heading, times.shape)])
    if not np.isfinite(rows).all():
        raise SettingError("position", "expected finite numbers in position and yaw")
    return times, rows


def run_polynomials(run: RecordedRun, pieces: int = MOST_PIECES) -> PolynomialPath:
    """Fit pieces of polynomials to the flown path of a run, see `fit_polynomials`.

    The yaw is the heading of the vehicle. If it turns over in flight, its first heading is held.
    """
    columns = run.telemetry
    position = np.column_stack([columns[name] for name in ("px", "py", "pz")])
    attitude = tuple(columns[name] for name in ("qw", "qx", "qy", "qz"))
    # The body's x axis and the height of its z axis, in the world
    x_east, x_north, *_, z_up = body_axes(attitude)
    heading = np.unwrap(np.arctan2(x_north, x_east))
    turns_over = bool(z_up.min() < cos(LARGEST_TILT))
    yaw = float(heading[0]) if turns_over else heading
    fitted = fit_polynomials(columns["t"], position, yaw, pieces)
    return replace(fitted, yaw_held=turns_over)
