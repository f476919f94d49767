"""The planner's numbers that `race tune` searches, with their ranges."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import sqrt
from typing import Literal, get_args, get_type_hints

import yaml

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs.race import RaceWeights, Weight
from quadsim.controllers.costs.reference import ReferenceWeights
from quadsim.controllers.presets import PRESETS, Planner

ParameterGroup = Literal["sigma", "gamma", "temperature", "cost", "margin", "horizon"]
GROUPS: tuple[ParameterGroup, ...] = get_args(ParameterGroup)
Values = Mapping[str, float]  # name of a parameter -> its value


@dataclass(frozen=True)
class Channels:
    """Controls that share one number of a sampler, such as sigma of the roll and pitch rates."""

    field: Literal["sigma", "gamma"]
    controls: tuple[int, ...]  # indices: 0, 1, 2 are the body rates about x, y, z; 3 is thrust


CHANNELS = {
    "sigma_rates": Channels("sigma", (0, 1)),
    "sigma_yaw": Channels("sigma", (2,)),
    "sigma_thrust": Channels("sigma", (3,)),
    "gamma_rates": Channels("gamma", (0, 1, 2)),
    "gamma_thrust": Channels("gamma", (3,)),
}
OF_MPPI = ("temperature", "target_ess", "tighten", "horizon")
# The temperature scales all weights, so only their ratios matter and one of them stays fixed.
FIXED_WEIGHT = "progress"

FACTOR = 4.0  # standard deviations and weights range from base / FACTOR to base * FACTOR
GAMMA = (0.0, 4.0)
ESS = (4.0, 400.0)
TEMPERATURE = (0.01, 10.0)
MARGIN = (0.0, 0.6)  # [m]
TIGHTEN = (0.0, 0.1)
HORIZON = (40, 220)  # [steps]
HORIZON_STEP = 10


@dataclass(frozen=True)
class Parameter:
    """A number to search, with its range and the value at which the search begins."""

    name: str
    low: float
    high: float
    base: float
    log: bool = False
    step: int | None = None  # the value is a whole number, `low` plus a multiple of this

    @property
    def start(self) -> float:
        """The base, or the nearest end of the range if the base lies outside."""
        return min(max(self.base, self.low), self.high)


def parameters(planner: Planner, groups: Sequence[str]) -> Iterator[Parameter]:
    """Yield the parameters of these groups that the planner has.

    Args:
        planner: planner that the search begins with.
        groups: some of GROUPS.
    """
    yield from _of_sampler(planner, groups)
    yield from _of_mppi(planner, groups)
    yield from _of_cost(planner, groups)


def _of_sampler(planner: Planner, groups: Sequence[str]) -> Iterator[Parameter]:
    numbers = vars(planner.sampling)
    for name, channels in CHANNELS.items():
        if channels.field not in groups or channels.field not in numbers:
            continue
        base = numbers[channels.field][channels.controls[0]]
        if channels.field == "gamma":
            yield Parameter(name, *GAMMA, base)
        else:
            yield _around(name, base)


def _of_mppi(planner: Planner, groups: Sequence[str]) -> Iterator[Parameter]:
    mppi = planner.mppi
    if "temperature" in groups:
        yield _temperature(mppi)
    if "margin" in groups:
        yield Parameter("tighten", *TIGHTEN, mppi.tighten)
    if "horizon" in groups:
        yield Parameter("horizon", *HORIZON, mppi.horizon, step=HORIZON_STEP)


def _temperature(mppi: MPPIConfig) -> Parameter:
    """Return the parameter of the temperature, or of the effective sample size that sets it."""
    if mppi.target_ess is None:
        return Parameter("temperature", *TEMPERATURE, mppi.temperature, log=True)
    low, high = ESS
    most = 16 * sqrt(mppi.samples)  # half of the samples, see MPPIConfig.ess_of
    return Parameter("target_ess", low, min(high, most), mppi.target_ess, log=True)


def _of_cost(planner: Planner, groups: Sequence[str]) -> Iterator[Parameter]:
    cost = planner.cost
    # The margin of a reference cost is not searched, as the reference was computed with it.
    if "margin" in groups and isinstance(cost, RaceWeights):
        yield Parameter("margin", *MARGIN, cost.margin)
    if "cost" in groups:
        for name in weights_of(cost):
            base = vars(cost)[name]
            if base:
                yield _around(name, base)


def weights_of(cost: RaceWeights | ReferenceWeights) -> tuple[str, ...]:
    """Return the names of the cost's weights that are searched."""
    _, weight_setting = get_args(Weight)
    hints = get_type_hints(type(cost), include_extras=True)
    weights = [name for name, hint in hints.items() if weight_setting in get_args(hint)]
    return tuple(name for name in weights if name != FIXED_WEIGHT)


def _around(name: str, base: float) -> Parameter:
    return Parameter(name, base / FACTOR, base * FACTOR, base, log=True)


def with_parameters(planner: Planner, values: Values) -> Planner:
    """Return the planner with these values.

    They are rounded to three digits, so that a preset file holds exactly what was flown.
    """
    rounded = {name: _three_digits(value) for name, value in values.items()}
    mppi = {name: value for name, value in rounded.items() if name in OF_MPPI}
    cost = {name: value for name, value in rounded.items() if name not in {*OF_MPPI, *CHANNELS}}

    sampling = planner.sampling
    for name, channels in CHANNELS.items():
        if name in rounded:
            numbers = list(vars(sampling)[channels.field])
            for control in channels.controls:
                numbers[control] = rounded[name]
            sampling = replace(sampling, **{channels.field: tuple(numbers)})

    return replace(
        planner,
        sampling=sampling,
        mppi=replace(planner.mppi, **mppi),
        cost=replace(planner.cost, **cost),
    )


def _three_digits(value: float) -> float:
    return value if isinstance(value, int) else float(f"{value:.3g}")


def preset_text(planner: Planner, preset: str, comment: str) -> str:
    """Return the text of a preset file with every number of the planner.

    The preset stays the same when the presets of the library change, as it has every number.

    Args:
        planner: planner with one of the library's samplers.
        preset: name or file of the preset that the planner comes from.
        comment: comment lines at the head of the file.
    """
    content: dict[str, object] = {
        "base": preset if preset in PRESETS else next(iter(PRESETS)),
        "vehicle": planner.vehicle,
    }
    parts = {"sampling": planner.sampling, "mppi": planner.mppi, "cost": planner.cost}
    for name, part in parts.items():
        numbers = asdict(part).items()
        # An empty tuple stands for "none", which a file says by leaving the key out.
        content[name] = {key: _plain(value) for key, value in numbers if value != ()}
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    return head + yaml.safe_dump(content, default_flow_style=None, sort_keys=False, width=120)


def _plain(value: object) -> object:
    """Return a tuple as a list, as YAML knows no tuples."""
    return list(value) if isinstance(value, tuple) else value
