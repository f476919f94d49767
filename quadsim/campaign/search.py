"""The search of `race tune`: the planner's parameters, the objective, and the Pareto front.

optuna proposes parameters and is told how they flew; its journal file survives a kill.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

import yaml

from controllers.costs.race import RaceWeights
from controllers.presets import PRESETS, Planner
from quadsim.campaign.summary_stats import VariantStats
from quadsim.console import UsageError
from quadsim.files.extras import needs_extra
from quadsim.record.run import RunError

Group = Literal["sigma", "gamma", "temperature", "cost", "margin", "horizon"]
GROUPS: tuple[Group, ...] = get_args(Group)
CHANNELS = {  # parameter -> what of the sampler, of which controls
    "sigma_rates": ("sigma", (0, 1)),
    "sigma_yaw": ("sigma", (2,)),
    "sigma_thrust": ("sigma", (3,)),
    "gamma_rates": ("gamma", (0, 1, 2)),
    "gamma_thrust": ("gamma", (3,)),
}
FACTOR = 4.0  # sigmas and weights: from a quarter of the base's to four times
GAMMA = (0.0, 4.0)
ESS = (4.0, 800.0)
TEMPERATURE = (0.01, 10.0)
MARGIN = (0.0, 0.6)  # [m]
TIGHTEN = (0.0, 0.1)
HORIZON = (40, 220, 10)  # [steps]: from, to, in steps of
STARTUP = 12  # trials drawn at random before optuna models the good ones
FAILED = "failed"  # attribute of a trial
FIXED = ("progress",)  # weights: with the temperature free, only their ratios matter


@dataclass(frozen=True)
class Parameter:
    """One number of the search: its range, and its value in the planner that the search begins
    with."""

    name: str
    low: float
    high: float
    base: float
    log: bool = False
    step: int | None = None  # whole numbers


def parameters(planner: Planner, sampler: str, groups: Sequence[str]) -> Iterator[Parameter]:
    """Of these groups, those that the sampler and the planner have. Roll and pitch share theirs."""
    s, m, c = planner.sampling, planner.mppi, planner.cost
    for name, (of, channels) in CHANNELS.items():
        if of in groups and hasattr(s, of):
            base = getattr(s, of)[channels[0]]
            yield Parameter(name, *GAMMA, base) if of == "gamma" else _around(name, base)
    if "temperature" in groups:
        if m.target_ess is None:
            yield Parameter("temperature", *TEMPERATURE, m.temperature, log=True)
        else:
            yield Parameter(
                "target_ess", ESS[0], min(ESS[1], m.samples / 2), m.target_ess, log=True
            )
    # the margin of a reference is part of what it is
    if "margin" in groups and isinstance(c, RaceWeights):
        yield Parameter("margin", *MARGIN, c.margin)
    if "margin" in groups:
        yield Parameter("tighten", *TIGHTEN, m.tighten)
    if "horizon" in groups:
        yield Parameter("horizon", *HORIZON[:2], m.horizon, step=HORIZON[2])
    if "cost" in groups:
        for name in weights_of(c):
            if weight := getattr(c, name):
                yield _around(name, weight)


def weights_of(cost: Any) -> tuple[str, ...]:
    """The names of those that are searched."""
    return tuple(f.name for f in fields(cost) if f.type == "Weight" and f.name not in FIXED)


def _around(name: str, base: float) -> Parameter:
    return Parameter(name, base / FACTOR, base * FACTOR, base, log=True)


def with_parameters(planner: Planner, values: dict[str, float]) -> Planner:
    """The planner with these values, rounded to three digits, so that a preset file holds what was
    flown."""
    v = {k: x if isinstance(x, int) else float(f"{x:.3g}") for k, x in values.items()}
    changes: dict[str, dict] = {
        group: {k: x for k, x in v.items() if hasattr(getattr(planner, group), k)}
        for group in ("mppi", "cost")
    }
    sampling: dict[str, list[float]] = {
        of: [*getattr(planner.sampling, of, ())] for of, _ in CHANNELS.values()
    }
    for name, (of, channels) in CHANNELS.items():
        for channel in channels if name in v else ():
            sampling[of][channel] = v[name]
    changes["sampling"] = {of: tuple(numbers) for of, numbers in sampling.items() if numbers}
    return replace(
        planner,
        **{group: replace(getattr(planner, group), **said) for group, said in changes.items()},
    )


def preset_text(planner: Planner, preset: str, comment: str) -> str:
    """A preset file with every number, so that it does not change when the presets of the library
    do."""
    parts = {k: asdict(getattr(planner, k)) for k in ("sampling", "mppi", "cost")}
    head = {
        "base": preset if preset in PRESETS else next(iter(PRESETS)),
        "vehicle": planner.vehicle,
    }
    lists = {
        k: {n: list(x) if isinstance(x, tuple) else x for n, x in part.items()}
        for k, part in parts.items()
    }
    lines = [f"# {line}" for line in comment.splitlines()]
    return (
        "\n".join(lines)
        + "\n"
        + yaml.safe_dump(head | lists, default_flow_style=None, sort_keys=False, width=120)
    )


def pareto(points: Sequence[tuple[float, ...]]) -> list[int]:
    """Indices of the points that no other dominates: nowhere worse and somewhere better; less is
    better."""

    def dominates(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
        return a != b and all(x <= y for x, y in zip(a, b, strict=True))

    return [i for i, p in enumerate(points) if not any(dominates(q, p) for q in points)]


def objective(n: VariantStats, floor: float) -> float:
    """Mean lap of those that finish if enough do, else with the time limit for each that does not
    [s]."""
    return n.lap_mean if n.finished and n.finished >= floor * n.attempts else n.penalised_mean


class Search:
    """Ask for trials, tell how they flew. Continues the search of this name where the journal holds
    one."""

    def __init__(self, journal: Path, name: str, parameters: Sequence[Parameter]):
        """Raises UsageError, RunError."""
        optuna = _import_optuna()
        self._study: Any = _open_study(optuna, journal, name)
        self._states = optuna.trial.TrialState
        self._space = {p.name: _distribution(optuna, p) for p in parameters}
        self._sampler = partial(
            optuna.samplers.TPESampler,
            multivariate=True,
            constant_liar=True,
            n_startup_trials=STARTUP,
        )
        for trial in self._trials("RUNNING"):  # a kill left them open: try them again
            self._study.tell(trial.number, state=self._states.FAIL)
            if trial.params.keys() == self._space.keys():  # else it is proposed again
                self._study.enqueue_trial(trial.params)
        if not self._asked and not self._trials("WAITING"):
            self._study.enqueue_trial({p.name: min(max(p.base, p.low), p.high) for p in parameters})

    def _trials(self, *states: str) -> list[Any]:
        """Default: that were flown."""
        found = tuple(self._states[state] for state in states or ("COMPLETE",))
        return self._study.get_trials(deepcopy=False, states=found)

    @property
    def done(self) -> int:
        return len(self._trials())

    @property
    def _asked(self) -> int:
        """Trials that are flown, or cannot be; those that a kill left open do not count."""
        return len(self._trials("COMPLETE", "RUNNING")) + sum(
            t.user_attrs.get(FAILED, False) for t in self._trials("FAIL")
        )

    def ask(self, number: int) -> list[Any]:
        return [self._ask() for _ in range(number)]

    def _ask(self) -> Any:
        """A seed for each: what is proposed depends on the trials so far, not on where the search
        was stopped."""
        self._study.sampler = self._sampler(seed=self._asked)
        return self._study.ask(self._space)

    def tell(self, trial: Any, n: VariantStats, floor: float) -> None:
        stats = {"lap": n.lap_mean, "finished": n.finished, "thrust_tv": n.thrust_tv}
        trial.set_user_attr("stats", {k: v for k, v in stats.items() if v == v})
        self._study.tell(trial, objective(n, floor))

    def fail(self, trial: Any) -> None:
        """It could not be flown."""
        trial.set_user_attr(FAILED, True)
        self._study.tell(trial, state=self._states.FAIL)

    def best(self, number: int) -> list[tuple[int, dict]]:
        """Trial numbers and their parameters, best first; no parameters twice."""
        ranked = sorted(self._trials(), key=lambda t: t.value)
        unique = {str(sorted(t.params.items())): t for t in reversed(ranked)}
        return [
            (t.number, t.params) for t in sorted(unique.values(), key=lambda t: t.value)[:number]
        ]

    def front(self) -> list[dict]:
        """Trials with a lap that no other dominates in lap time, success and thrust variation,
        fastest first."""
        trials = [t for t in self._trials() if "lap" in t.user_attrs.get("stats", ())]
        told = [{"trial": t.number, **t.user_attrs["stats"], "params": t.params} for t in trials]
        best = pareto([(n["lap"], -n["finished"], n["thrust_tv"]) for n in told])
        return sorted((told[i] for i in best), key=lambda n: n["lap"])


def _open_study(optuna: Any, path: Path, name: str) -> Any:
    """Raises RunError."""
    from quadsim.campaign.journal import Journal  # which needs optuna

    journal = Journal(path)
    try:
        storage = optuna.storages.JournalStorage(journal)
        return optuna.create_study(storage=storage, study_name=name, load_if_exists=True)
    except RunError:
        raise
    except Exception as error:  # a record that optuna did not write fails in a dozen ways
        raise journal.damaged(f"not what optuna writes: {type(error).__name__} {error}") from error


def _import_optuna() -> Any:
    try:
        import optuna
    except ImportError:
        raise UsageError(needs_extra("optuna", "tune")) from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)
    return optuna


def _distribution(optuna: Any, p: Parameter) -> Any:
    if p.step:
        return optuna.distributions.IntDistribution(int(p.low), int(p.high), step=p.step)
    return optuna.distributions.FloatDistribution(p.low, p.high, log=p.log)
