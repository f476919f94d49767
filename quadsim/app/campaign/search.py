"""What `race tune` may turn, and which of several planners nobody beats."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Literal

import yaml

from controllers.costs.race import RaceWeights
from controllers.presets import PRESETS, Planner, per_channel

Group = Literal["sigma", "gamma", "temperature", "cost", "margin", "horizon"]
FACTOR = 4.0  # sigmas and weights: from a quarter of the base's to four times
GAMMA = (0.0, 4.0)
ESS = (4.0, 800.0)
TEMPERATURE = (0.01, 10.0)
MARGIN = (0.0, 0.6)  # [m]
TIGHTEN = (0.0, 0.1)
HORIZON = (40, 220, 10)  # [steps]: from, to, in steps of
FIXED = ("progress",)  # weights: with the temperature free, only their ratios matter
WEIGHTS = tuple(f.name for f in fields(RaceWeights) if f.type == "Weight" and f.name not in FIXED)


@dataclass(frozen=True)
class Knob:
    """One number of the search: its range and the base's own value."""

    name: str
    low: float
    high: float
    base: float
    log: bool = False
    step: int | None = None  # whole numbers


def knobs(planner: Planner, sampler: str, groups: Sequence[str]) -> Iterator[Knob]:
    """Of the groups asked for, those the sampler and the base have. Roll and pitch share theirs."""
    s, m, c = planner.sampling, planner.mppi, planner.cost
    if "sigma" in groups:
        for name, base in (("sigma_rates", s.sigma[0]), ("sigma_yaw", s.sigma[2]), ("sigma_thrust", s.sigma[3])):
            yield Knob(name, base / FACTOR, base * FACTOR, base, log=True)
    if "gamma" in groups and sampler == "colored":
        yield Knob("gamma_rates", *GAMMA, s.gamma[0])
        yield Knob("gamma_thrust", *GAMMA, s.gamma[3])
    if "temperature" in groups:
        if m.ess is None:
            yield Knob("temperature", *TEMPERATURE, m.temperature, log=True)
        else:
            yield Knob("ess", ESS[0], min(ESS[1], m.samples / 2), m.ess, log=True)
    if "margin" in groups:
        yield Knob("margin", *MARGIN, c.margin)
        yield Knob("tighten", *TIGHTEN, m.tighten)
    if "horizon" in groups:
        yield Knob("horizon", *HORIZON[:2], m.horizon, step=HORIZON[2])
    if "cost" in groups:
        for name in WEIGHTS:
            if weight := getattr(c, name):
                yield Knob(name, weight / FACTOR, weight * FACTOR, weight, log=True)


def turned(planner: Planner, values: dict[str, float]) -> Planner:
    """The planner with these knobs turned, to three digits: what a file says is what was flown."""
    v = {k: x if isinstance(x, int) else float(f"{x:.3g}") for k, x in values.items()}
    s, g = planner.sampling.sigma, planner.sampling.gamma
    rates = v.get("sigma_rates", s[0])
    sigma = (rates, rates, v.get("sigma_yaw", s[2]), v.get("sigma_thrust", s[3])) if _any(v, "sigma") else s
    gamma = per_channel(v.get("gamma_rates", g[0]), v.get("gamma_thrust", g[3])) if _any(v, "gamma") else g
    mppi = {k: v[k] for k in ("temperature", "ess", "horizon", "tighten") if k in v}
    cost = {k: v[k] for k in (*WEIGHTS, "margin") if k in v}
    return replace(
        planner,
        sampling=replace(planner.sampling, sigma=sigma, gamma=gamma),
        mppi=replace(planner.mppi, **mppi),
        cost=replace(planner.cost, **cost),
    )


def preset_text(planner: Planner, preset: str, comment: str) -> str:
    """A preset file that says every number, so that it stays what it is when the presets move on."""
    parts = {k: asdict(getattr(planner, k)) for k in ("sampling", "mppi", "cost")}
    head = {"base": preset if preset in PRESETS else next(iter(PRESETS)), "vehicle": planner.vehicle}
    lists = {k: {n: list(x) if isinstance(x, tuple) else x for n, x in part.items()} for k, part in parts.items()}
    lines = [f"# {line}" for line in comment.splitlines()]
    return "\n".join(lines) + "\n" + yaml.safe_dump(head | lists, default_flow_style=None, sort_keys=False, width=120)


def pareto(points: Sequence[tuple[float, ...]]) -> list[int]:
    """Indices of the points that no other beats: nowhere worse and somewhere better; less is better."""

    def beats(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
        return a != b and all(x <= y for x, y in zip(a, b, strict=True))

    return [i for i, p in enumerate(points) if not any(beats(q, p) for q in points)]


def _any(values: dict[str, float], prefix: str) -> bool:
    return any(k.startswith(prefix) for k in values)
