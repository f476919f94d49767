"""Numbers of the planner with a slider on the page, which may change in flight.

A slider controls a setting of the planner, or a part of it: `sigma` scales the standard deviations
of the preset, `gamma` has one slider for the body rates and one for the thrust.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from quadsim.controllers.presets import Planner, per_channel
from quadsim.controllers.samplers import Colored
from quadsim.dynamics.quadrotor import Control
from quadsim.record.schema import ReplayedPlanner

# A planner, or what the record of a run says of one
AnyPlanner = Planner | ReplayedPlanner
# value of a planner beside its preset; None: the preset is unknown
Read = Callable[[AnyPlanner, AnyPlanner | None], float]
# planner with another value, beside its preset
Write = Callable[[Planner, Planner, float], Planner]


class Change(NamedTuple):
    """A requested change of a number in flight."""

    name: str  # of SLIDERS
    value: float | None  # None: the preset's value


@dataclass(frozen=True)
class Slider:
    """The range of a slider, and what its number is of a planner."""

    setting: str  # name of the annotated setting
    label: str
    low: float
    high: float
    step: float
    hint: str
    read: Read
    write: Write


def _sigma_scale(planner: AnyPlanner, preset: AnyPlanner | None) -> float:
    own = _of_sampling(planner, "sigma")
    usual = _of_sampling(preset, "sigma") if preset else ()
    return round(own[0] / usual[0], 4) if own and usual else 1.0


def _with_sigma_scale(planner: Planner, preset: Planner, value: float) -> Planner:
    return _with_sampling(planner, sigma=tuple(value * sigma for sigma in preset.sampling.sigma))


def _gamma_rates(planner: AnyPlanner, _: AnyPlanner | None) -> float:
    gamma = _of_sampling(planner, "gamma")
    return gamma[0] if gamma else 0.0


def _gamma_thrust(planner: AnyPlanner, _: AnyPlanner | None) -> float:
    gamma = _of_sampling(planner, "gamma")
    return gamma[-1] if gamma else 0.0


def _with_gamma_rates(planner: Planner, _: Planner, value: float) -> Planner:
    if not isinstance(planner.sampling, Colored):
        return planner
    thrust = Control(*planner.sampling.gamma).thrust
    return _with_sampling(planner, gamma=per_channel(value, thrust))


def _with_gamma_thrust(planner: Planner, _: Planner, value: float) -> Planner:
    if not isinstance(planner.sampling, Colored):
        return planner
    rates = Control(*planner.sampling.gamma).wx
    return _with_sampling(planner, gamma=per_channel(rates, value))


def _temperature(planner: AnyPlanner, _: AnyPlanner | None) -> float:
    return planner.mppi.temperature


def _with_temperature(planner: Planner, _: Planner, value: float) -> Planner:
    return _with_mppi(planner, temperature=value)


def _target_ess(planner: AnyPlanner, _: AnyPlanner | None) -> float:
    return planner.mppi.target_ess or 0.0


def _with_target_ess(planner: Planner, _: Planner, value: float) -> Planner:
    # a target below one sample means a fixed temperature
    return _with_mppi(planner, target_ess=value if value >= 1 else None)


def _samples(planner: AnyPlanner, _: AnyPlanner | None) -> float:
    return planner.mppi.samples


def _with_samples(planner: Planner, _: Planner, value: float) -> Planner:
    return _with_mppi(planner, samples=int(value))


SLIDERS = {
    "sigma": Slider(
        setting="sigma",
        label="Sigma scale",
        low=0.1,
        high=4.0,
        step=0.05,
        hint="factor on the preset's standard deviations: how far the samples are from the plan",
        read=_sigma_scale,
        write=_with_sigma_scale,
    ),
    "gamma_rates": Slider(
        setting="gamma",
        label="Gamma rates",
        low=0.0,
        high=6.0,
        step=0.05,
        hint="colour of the body rates' noise, 1/f^gamma: 0 is white and makes commands chatter, a "
        "larger gamma makes them smoother",
        read=_gamma_rates,
        write=_with_gamma_rates,
    ),
    "gamma_thrust": Slider(
        setting="gamma",
        label="Gamma thrust",
        low=0.0,
        high=6.0,
        step=0.05,
        hint="colour of the thrust's noise, 1/f^gamma: 0 is white and makes the thrust chatter, a "
        "larger gamma makes it smoother",
        read=_gamma_thrust,
        write=_with_gamma_thrust,
    ),
    "temperature": Slider(
        setting="temperature",
        label="Temperature",
        low=0.01,
        high=10.0,
        step=0.01,
        hint="lambda: at a low one the plan follows the cheapest samples, at a high one it is the "
        "mean of many; with a target ESS it is solved for",
        read=_temperature,
        write=_with_temperature,
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
        read=_target_ess,
        write=_with_target_ess,
    ),
    "samples": Slider(
        setting="samples",
        label="Samples",
        low=256,
        high=8192,
        step=256,
        hint="control sequences that are tried in each iteration: with more, plans are better and "
        "take longer",
        read=_samples,
        write=_with_samples,
    ),
}


def numbers_of(planner: AnyPlanner, preset: AnyPlanner | None) -> dict[str, float]:
    """Return the values of the sliders for a planner derived from a preset; None: unknown."""
    return {name: slider.read(planner, preset) for name, slider in SLIDERS.items()}


def with_change(planner: Planner, preset: Planner, change: Change) -> Planner:
    """Return the planner with a changed number; unchanged if its sampler lacks the number."""
    if change.name not in SLIDERS:
        raise ValueError(f"{change.name}: expected one of {', '.join(SLIDERS)}")
    slider = SLIDERS[change.name]
    value = slider.read(preset, preset) if change.value is None else change.value
    return slider.write(planner, preset, value)


def _of_sampling(planner: AnyPlanner, name: str) -> Sequence[float]:
    """Return a parameter of the sampler, such as sigma, one number per control.

    Empty if the sampler lacks the parameter or its value is unknown.
    """
    return tuple(getattr(planner.sampling, name, ()))


def _with_sampling(planner: Planner, **numbers: tuple[float, ...]) -> Planner:
    sampling: Any = planner.sampling
    return replace(planner, sampling=replace(sampling, **numbers))


def _with_mppi(planner: Planner, **numbers: Any) -> Planner:
    """Return the planner with changed numbers; at most half of the samples can have weight."""
    mppi = replace(planner.mppi, **numbers)
    ess = mppi.ess_of(mppi.samples)
    if mppi.target_ess and ess:
        mppi = replace(mppi, target_ess=mppi.target_ess * min(1.0, mppi.samples / 2 / ess))
    return replace(planner, mppi=mppi)
