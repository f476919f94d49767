"""Numbers of the planner with a slider on the page, which may change in flight.

A slider controls a setting of the planner, or a part of it: `sigma` scales the standard deviations
of the preset, `gamma` has one slider for the body rates and one for the thrust.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from quadsim.controllers.presets import Planner, per_channel
from quadsim.controllers.samplers import Colored
from quadsim.dynamics.quadrotor import Control


class Change(NamedTuple):
    """A requested change of a number in flight."""

    name: str  # of SLIDERS
    value: float | None  # None: the preset's value


@dataclass(frozen=True)
class Slider:
    """The range of a slider, and the effect of its number."""

    setting: str  # name of the annotated setting
    label: str
    low: float
    high: float
    step: float
    hint: str


SLIDERS = {
    "sigma": Slider(
        setting="sigma",
        label="Sigma scale",
        low=0.1,
        high=4.0,
        step=0.05,
        hint="factor on the preset's standard deviations: how far the samples are from the plan",
    ),
    "gamma_rates": Slider(
        setting="gamma",
        label="Gamma rates",
        low=0.0,
        high=6.0,
        step=0.05,
        hint="colour of the body rates' noise, 1/f^gamma: 0 is white and makes commands chatter, a "
        "larger gamma makes them smoother",
    ),
    "gamma_thrust": Slider(
        setting="gamma",
        label="Gamma thrust",
        low=0.0,
        high=6.0,
        step=0.05,
        hint="colour of the thrust's noise, 1/f^gamma: 0 is white and makes the thrust chatter, a "
        "larger gamma makes it smoother",
    ),
    "temperature": Slider(
        setting="temperature",
        label="Temperature",
        low=0.01,
        high=10.0,
        step=0.01,
        hint="lambda: at a low one the plan follows the cheapest samples, at a high one it is the "
        "mean of many; with a target ESS it is solved for",
    ),
    # 0: the temperature is fixed
    "target_ess": Slider(
        setting="target_ess",
        label="Target ESS",
        low=0.0,
        high=200.0,
        step=1.0,
        hint="how many of 1024 samples the temperature gives weight (effective sample size); it "
        "grows with the square root of the samples; 0: the temperature stays as it is",
    ),
    "samples": Slider(
        setting="samples",
        label="Samples",
        low=256,
        high=8192,
        step=256,
        hint="control sequences that are tried in each iteration: with more, plans are better and "
        "take longer",
    ),
}


def slider_values(
    sigma: Sequence[float],
    preset_sigma: Sequence[float],
    gamma: Sequence[float],
    temperature: float,
    target_ess: float | None,
    samples: int,
) -> dict[str, float]:
    """Return the values of the sliders for a planner with these numbers.

    Args:
        sigma, preset_sigma: standard deviations of the controls, and the ones at scale 1; empty:
            unknown.
        gamma: color exponents, of the body rates first and of the thrust last; empty: no gamma.
    """
    known = len(sigma) > 0 and len(preset_sigma) > 0
    return {
        "sigma": round(sigma[0] / preset_sigma[0], 4) if known else 1.0,
        "gamma_rates": gamma[0] if gamma else 0.0,
        "gamma_thrust": gamma[-1] if gamma else 0.0,
        "temperature": temperature,
        "target_ess": target_ess or 0.0,
        "samples": samples,
    }


def numbers_of(planner: Planner, preset: Planner) -> dict[str, float]:
    """Return the values of the sliders for a planner derived from a preset."""
    return slider_values(
        sigma=planner.sampling.sigma,
        preset_sigma=preset.sampling.sigma,
        gamma=planner.sampling.gamma if isinstance(planner.sampling, Colored) else (),
        temperature=planner.mppi.temperature,
        target_ess=planner.mppi.target_ess,
        samples=planner.mppi.samples,
    )


def with_change(planner: Planner, preset: Planner, change: Change) -> Planner:
    """Return the planner with a changed number; unchanged if its sampler lacks the number."""
    value = change.value
    if value is None:
        value = numbers_of(preset, preset)[change.name]
    match change.name:
        case "sigma":
            scaled = tuple(value * sigma for sigma in preset.sampling.sigma)
            return _with_sampling(planner, sigma=scaled)
        case "gamma_rates" | "gamma_thrust":
            if not isinstance(planner.sampling, Colored):
                return planner
            gamma = Control(*planner.sampling.gamma)
            rates = value if change.name == "gamma_rates" else gamma.wx
            thrust = value if change.name == "gamma_thrust" else gamma.thrust
            return _with_sampling(planner, gamma=per_channel(rates, thrust))
        case "target_ess":
            # a target below one sample means a fixed temperature
            mppi = replace(planner.mppi, target_ess=value if value >= 1 else None)
        case "samples":
            mppi = replace(planner.mppi, samples=int(value))
        case "temperature":
            mppi = replace(planner.mppi, temperature=value)
        case _:
            raise ValueError(f"{change.name}: expected one of {', '.join(SLIDERS)}")
    ess = mppi.ess_of(mppi.samples)
    if mppi.target_ess and ess:
        # At most half of the samples can have weight.
        mppi = replace(mppi, target_ess=mppi.target_ess * min(1.0, mppi.samples / 2 / ess))
    return replace(planner, mppi=mppi)


def _with_sampling(planner: Planner, **numbers: tuple[float, ...]) -> Planner:
    sampling: Any = planner.sampling
    return replace(planner, sampling=replace(sampling, **numbers))
