"""What was commanded against what was delivered, over time and over frequency."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from quadsim.app.figure_style import line
from quadsim.palette import FINE, INK, LIMIT, MARK, style
from quadsim.record.metrics import motor_corner, motor_tau, thrust_psd
from quadsim.record.run import Run

COMMANDED, DELIVERED = 2.0, 0.8  # line widths, so that both are seen where they agree
FEWEST = 16  # frames that a spectrum is worth


def draw_thrust(axes: Axes, run: Run) -> None:
    x, limit = run.telemetry, run.spec["vehicle"]["thrust_max"]
    _pair(axes, run, "a_cmd", "a")
    axes.axhline(limit, color=LIMIT, linestyle=":", linewidth=1.2)
    axes.set(title="thrust, mass-normalised [m/s$^2$]", ylim=(-0.5, 1.05 * max(limit, x["a"].max(initial=1.0))))
    axes.legend(loc="lower right", ncols=2)


def draw_rates(rows: Sequence[Axes], run: Run) -> None:
    for axes, name, axis in zip(rows, ("roll", "pitch", "yaw"), "xyz", strict=True):
        _pair(axes, run, f"w{axis}_cmd", f"w{axis}")
        axes.set_ylabel(name)
        axes.label_outer()
    rows[0].set_title("body rates [rad/s]")
    rows[-1].set_xlabel("t [s]")


def draw_spectrum(axes: Axes, run: Run) -> None:
    """Power spectral density of the thrust; what lies right of the corner, no motor follows."""
    x, tau = run.telemetry, motor_tau(run.spec["vehicle"])
    axes.set(title="thrust, power spectral density [(m/s$^2$)$^2$/Hz]", xlabel="f [Hz]")
    if len(x["t"]) < FEWEST:
        return
    commanded, delivered = line(style(run.spec["sampler"])), {"color": INK}
    for column, look, width, name in (
        ("a_cmd", commanded, COMMANDED, "commanded"),
        ("a", delivered, DELIVERED, "delivered"),
    ):
        f, psd = thrust_psd(x["t"], x[column])
        axes.loglog(f[1:], psd[1:], **look, linewidth=width, label=name)
    corner = motor_corner(tau)
    axes.axvline(corner, color=MARK, linestyle="--", linewidth=1.0, label=f"motors' corner, {corner:.1f} Hz")
    axes.grid(which="minor", color=FINE, linewidth=0.4)
    axes.legend(loc="lower left")


def _pair(axes: Axes, run: Run, commanded: str, delivered: str) -> None:
    x, colour = run.telemetry, style(run.spec["sampler"]).colour
    axes.step(x["t"], x[commanded], where="post", color=colour, linewidth=COMMANDED, label="commanded")
    axes.plot(x["t"], x[delivered], color=INK, linewidth=DELIVERED, label="delivered")
    for end in np.cumsum(run.laps):
        axes.axvline(end, color=LIMIT, linewidth=0.8)
    axes.margins(x=0.01)
