"""The pictures of concepts.md, all of them or by name; they take some minutes.

.venv/bin/python docs/concept_figures.py [NAME ...]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import islice
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from shared import save, use_style

import quadsim
from quadsim import Colored, Gaussian, MPPIConfig, Spec
from quadsim.config.build import build
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.controllers.in_flight import PlannerInFlight
from quadsim.controllers.mppi import MPPI, Iteration
from quadsim.controllers.sampled_trajectories import (
    SampledTrajectories,
    controls,
    sampled_trajectories,
)
from quadsim.controllers.update import weights
from quadsim.dynamics.estimate import Estimate
from quadsim.figures.course import gate_bar
from quadsim.palette import INK, MARK, NEXT, SPARE, style
from quadsim.paper.integrator import double_integrator, quadratic_cost
from quadsim.racing.flight import simulate
from quadsim.record.run import SHARES

COLORED = style("colored").colour
WHITE = style("gaussian").colour
GREY = "#a0a6ae"
SIZE = (9.0, 3.4)  # [inch]


def main() -> None:
    """Draw the pictures that the command line names, or all."""
    use_style()
    figures = (weights_and_temperature, noise, gates_in_the_rollout, randomized_seeds, adaptation)
    for draw in figures:
        if len(sys.argv) == 1 or draw.__name__ in sys.argv[1:]:
            save(draw(), f"concept_{draw.__name__}.png")


def point_planner(sampler: Any, horizon: int = 40, **numbers: Any) -> MPPI:
    """Return a planner of a point mass in the plane, on its way to the origin."""
    config = MPPIConfig(samples=512, horizon=horizon, dt=0.05, **numbers)
    return MPPI(double_integrator(0.05), quadratic_cost((0.0, 0.0)), sampler, config)


def weights_and_temperature() -> Any:
    """Draw samples of one iteration coloured by weight, and the weights by temperature."""
    figure, (plane, curve) = plt.subplots(1, 2, figsize=SIZE)
    mppi = point_planner(Colored((2.0, 2.0), (2.0, 2.0)), temperature=3.0, iterations=1)
    x = np.array([2.0, 1.0, -0.5, 1.0])
    for _ in range(3):
        mppi.control(Estimate(0.0, x))
    seen = sampled(mppi)
    J = np.sort(last_iteration(mppi).J)
    share = np.exp(-(seen.costs - seen.costs.min()) / mppi.temperature)
    for path, s in reversed(list(zip(seen.paths, share, strict=True))):
        plane.plot(*path[:, :2].T, color=plt.cm.viridis_r(s), linewidth=0.4 + 1.2 * s)
    plane.plot(*seen.plan[:, :2].T, color=INK, linewidth=2.5, label="plan: the weighted mean")
    plane.plot(*x[:2], "o", color=INK)
    plane.annotate("vehicle", x[:2], xytext=(6, -4), textcoords="offset points")
    plane.plot(0, 0, "*", color=NEXT, markersize=12)
    plane.annotate("goal", (0, 0), xytext=(7, -14), textcoords="offset points", weight="bold")
    plane.set(
        title="The 63 cheapest samples; dark: large weight",
        xlabel="x [m]",
        ylabel="y [m]",
        aspect="equal",
    )
    plane.legend(loc="lower right")
    for temperature, s in zip((0.3, 3.0, 30.0), SPARE, strict=False):
        w = weights(J, temperature)
        curve.loglog(
            np.arange(1, len(J) + 1),
            w,
            color=s.colour,
            label=f"λ = {temperature:g}: ESS {1 / (w @ w):.0f}",
        )
    curve.set(
        title="Weights of the 512 samples", xlabel="rank by cost", ylabel="weight w", ylim=(1e-6, 1)
    )
    curve.legend()
    return figure


def noise() -> Any:
    """Draw white and colored noise of one variance, and how far a point mass gets with each."""
    figure, (series, reach) = plt.subplots(1, 2, figsize=SIZE)
    t, x = 0.05 * np.arange(80), np.zeros(4)
    for sampler, colour, name in (
        (Gaussian((1.0, 1.0)), WHITE, "Gaussian"),
        (Colored((1.0, 1.0), (2.0, 2.0)), COLORED, "colored, γ = 2"),
    ):
        mppi = point_planner(sampler, horizon=80, temperature=1e6)
        mppi.control(x)
        v = perturbations(mppi)  # (30, n_u, T)
        series.plot(t, v[3, 0], color=colour, label=name)
        for path in mppi.rollout.trajectories(x, v, 0).states:
            reach.plot(*path[:, :2].T, color=colour, linewidth=0.8)
    series.set(
        title="One control of one sample, σ = 1", xlabel="t [s]", ylabel="perturbation [m/s²]"
    )
    series.legend()
    reach.set(
        title="Where 30 samples of each are after 4 s",
        xlabel="x [m]",
        ylabel="y [m]",
        aspect="equal",
    )
    return figure


def last_iteration(mppi: MPPI) -> Iteration:
    """Return the last iteration of a planner that has planned."""
    assert mppi.last is not None
    return mppi.last


def sampled(mppi: MPPI, points: int = 25) -> SampledTrajectories:
    """Return the sampled trajectories of a planner that has planned."""
    found = sampled_trajectories(mppi, points=points)
    assert found is not None
    return found


def perturbations(mppi: MPPI, count: int = 30) -> np.ndarray:
    """Return those of the last iteration, without samples 0 and 1.  (count, n_u, T)"""
    last = last_iteration(mppi)
    which = np.arange(2, 2 + count)
    return controls(mppi, last, which) - last.nominal.T


def flown_until(spec: Spec, t: float) -> MPPI:
    """Return the planner of a flight at time t [s]."""
    parts = build(spec)
    for frame in simulate(parts):
        if frame.t >= t:
            break
    parts.plant.close()
    assert isinstance(parts.controller, PlannerInFlight)
    assert isinstance(parts.controller.planner, MPPI)
    return parts.controller.planner


def gates_in_the_rollout() -> Any:
    """Draw a plan through two gates: samples turn to the next gate once through the last."""
    figure, axes = plt.subplots(figsize=(9.0, 3.8))
    spec = Spec.of("figure8", laps=1)
    mppi = flown_until(spec, 1.96)
    last = last_iteration(mppi)
    for path in sampled(mppi, points=100).paths[::-3]:
        for target, part in by_target(path, mppi):
            axes.plot(
                *part[:, :2].T,
                color=SPARE[target - last.target].colour,
                linewidth=0.7,
                label=f"towards gate {target + 1}",
            )
    for i, gate in enumerate(spec.course.gates):
        seen = gate_bar(gate)
        for post in zip(seen.opening, seen.frame, strict=True):
            axes.plot(*np.transpose(post), color=INK, linewidth=3)
        if i != 4:  # it stands above gate 1
            name = "gates 1 and 5" if i == 0 else f"gate {i + 1}"
            axes.annotate(
                name, gate.position[:2], xytext=(9, 12), textcoords="offset points", color=MARK
            )
    axes.plot(*last.x[:2], "o", color=INK)
    axes.set(
        title="Sampled trajectories of one plan, from above",
        xlabel="x [m]",
        ylabel="y [m]",
        aspect="equal",
    )
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(
        dict(zip(labels, handles, strict=True)).values(), dict.fromkeys(labels), loc="lower left"
    )
    return figure


def by_target(path: np.ndarray, mppi: MPPI) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the parts of a path (points, 3) with the target that each is on the way to."""
    target, first = last_iteration(mppi).target, 0
    for k in range(1, len(path)):
        # A row begins with a GateTarget; numbers of other terms follow.
        row = GateTarget(*mppi.cost.targets[target][: len(GateTarget._fields)])
        exit, passage = np.array([row.x, row.y, row.z]), np.array([row.nx, row.ny, row.nz])
        before, after = (path[k - 1 : k + 1] - exit) @ passage
        if before < 0.0 <= after:
            yield target, path[first : k + 1]
            first, target = k, target + 1
    yield target, path[first:]


def randomized_seeds() -> Any:
    """Draw flights of six seeds of domain randomization, from above, and their vehicles."""
    figure, (above, bars) = plt.subplots(1, 2, figsize=SIZE, width_ratios=(2, 1))
    names = {"mass": "mass", "thrust": "full thrust", "drag": "drag", "motor_lag": "rotor lag"}
    for seed in range(6):
        run = quadsim.fly("figure8", laps=1, seed=seed, randomize=1.0)
        colour = SPARE[seed].colour
        above.plot(
            run.telemetry["px"],
            run.telemetry["py"],
            color=colour,
            linewidth=0.9,
            label=f"{run.laps[0]:.2f} s",
        )
        drawn = [100 * run.spec["variation"][name] for name in names]
        bars.plot(
            drawn, np.arange(len(names)) + 0.09 * (seed - 2.5), "o", color=colour, markersize=4
        )
    above.set(
        title="One lap of six randomized seeds", xlabel="x [m]", ylabel="y [m]", aspect="equal"
    )
    above.legend(
        loc="upper center", ncols=6, columnspacing=1.0, handlelength=1.0, bbox_to_anchor=(0.5, -0.2)
    )
    bars.set_yticks(range(len(names)), names.values())
    bars.set(title="What was drawn", xlabel="difference from nominal [%]", xlim=(-30, 30))
    return figure


def adaptation() -> Any:
    """Draw what is learned of a vehicle of another mass, and of one with a rotor that fails."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.0))
    draw_thrust_gain(left)
    draw_shares(right)
    return figure


def draw_thrust_gain(axes: Axes) -> None:
    """Draw the thrust gain estimated in flight, of a vehicle whose model has another mass."""
    spec = Spec.of("figure8", laps=1, seed=3, randomize=1.0)
    parts = build(spec)
    learner = parts.navigation.learner if parts.navigation else None
    assert learner
    rows = []
    for frame in islice(simulate(parts), 300):
        rows.append((frame.t, learner.model.thrust_gain, learner.std.thrust_gain))
    parts.plant.close()
    t, gain, std = np.array(rows).T
    true = 1.0 / (1.0 + spec.record()["variation"]["mass"])
    axes.fill_between(
        t, gain - 2 * std, gain + 2 * std, color=WHITE, alpha=0.4, linewidth=0, label="± 2 sd"
    )
    axes.plot(t, gain, color=SPARE[0].colour, label="estimate")
    axes.axhline(true, color=INK, linestyle="--", linewidth=1, label="true: nominal over real mass")
    axes.set(title="Thrust gain: acceleration per thrust delivered", xlabel="t [s]", ylabel="gain")
    axes.legend()


def draw_shares(axes: Axes) -> None:
    """Draw the learned shares of four rotors, one of which fails, with and without sensors."""
    for k, (label, sensing) in enumerate({"true state": None, "vio": "vio"}.items()):
        run = quadsim.fly("split_s_swift", fault="rotor2=.7@1", sensing=sensing, timeout=2.0)
        shown = run.telemetry["t"] > 0.8
        t = run.telemetry["t"][shown]
        for share in SHARES:
            is_weak = share == "share2"
            colour = SPARE[k].colour if is_weak else GREY
            name = f"rotor 2, {label}" if is_weak else None
            axes.plot(t, run.telemetry[share][shown], color=colour, label=name, zorder=2 + is_weak)
    axes.step(
        [0.8, 1.0, 2.0], [1.0, 0.7, 0.7], where="post", color=INK, ls="--", lw=1, label="true"
    )
    axes.set(title="Thrust of each rotor: share of the nominal one", xlabel="t [s]", ylabel="share")
    axes.legend()


if __name__ == "__main__":
    main()
