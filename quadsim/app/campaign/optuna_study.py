"""The search behind `race tune`: optuna asked for knobs and told what flew; its journal file survives a kill."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from quadsim.app.campaign.search import Knob
from quadsim.app.campaign.summary_stats import VariantStats
from quadsim.app.flags import UsageError
from quadsim.record.run import RunError

STARTUP = 12  # trials at random before the model of the good ones takes over


def objective(n: VariantStats, floor: float) -> float:
    """Mean lap of those that finish where enough do, else with the time limit for each that does not [s]."""
    return n.lap_mean if n.finished and n.finished >= floor * n.attempts else n.penalised_mean


class Study:
    """Ask for trials, tell their numbers."""

    def __init__(self, study: Any, space: dict, states: Any):
        self._study, self._space, self._states = study, space, states

    def _all(self, state: Any) -> list[Any]:
        return self._study.get_trials(deepcopy=False, states=(state,))

    @property
    def done(self) -> int:
        return len(self._all(self._states.COMPLETE))

    def ask(self, number: int) -> list[Any]:
        return [self._study.ask(self._space) for _ in range(number)]

    def tell(self, trial: Any, n: VariantStats, floor: float) -> None:
        numbers = {"lap": n.lap_mean, "finished": n.finished, "thrust_tv": n.thrust_tv}
        trial.set_user_attr("numbers", {k: v for k, v in numbers.items() if v == v})
        self._study.tell(trial, objective(n, floor))

    def fail(self, trial: Any) -> None:
        self._study.tell(trial, state=self._states.FAIL)

    def best(self, number: int) -> list[tuple[int, dict]]:
        """Trial numbers and their knobs, best first; no knobs twice."""
        ranked = sorted(self._all(self._states.COMPLETE), key=lambda t: t.value)
        unique = {str(sorted(t.params.items())): t for t in reversed(ranked)}
        return [(t.number, t.params) for t in sorted(unique.values(), key=lambda t: t.value)[:number]]

    def told(self) -> list[dict]:
        """Numbers and knobs of every trial that has a lap."""
        trials = [t for t in self._all(self._states.COMPLETE) if "lap" in t.user_attrs["numbers"]]
        return [{"trial": t.number, **t.user_attrs["numbers"], "params": t.params} for t in trials]

    def take_up(self, start: dict) -> None:
        """Begin with the planner one starts from; trials that a kill left open are tried again."""
        if not self._study.get_trials(deepcopy=False):
            self._study.enqueue_trial(start)
        for trial in self._all(self._states.RUNNING):
            self._study.tell(trial.number, state=self._states.FAIL)
            self._study.enqueue_trial(trial.params)


def open_study(journal: Path, name: str, knobs: Sequence[Knob]) -> Study:
    """The study of this name, new or as it was left. Raises UsageError, RunError."""
    try:
        import optuna
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalFileBackend
    except ImportError:
        raise UsageError("race tune needs the extra 'tune': pip install 'quadsim[tune]'") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)
    try:
        journal.parent.mkdir(parents=True, exist_ok=True)
        storage = JournalStorage(JournalFileBackend(str(journal)))
        inner = optuna.create_study(storage=storage, study_name=name, load_if_exists=True)
    except OSError as error:
        raise RunError(f"{journal}: cannot keep the search here: {error}") from error
    so_far = len(inner.get_trials(deepcopy=False))  # as the seed, so that what goes on does not begin again
    inner.sampler = optuna.samplers.TPESampler(
        seed=so_far, multivariate=True, constant_liar=True, n_startup_trials=STARTUP
    )
    study = Study(inner, {k.name: _distribution(optuna, k) for k in knobs}, optuna.trial.TrialState)
    study.take_up({k.name: min(max(k.base, k.low), k.high) for k in knobs})
    return study


def _distribution(optuna: Any, k: Knob) -> Any:
    if k.step:
        return optuna.distributions.IntDistribution(int(k.low), int(k.high), step=k.step)
    return optuna.distributions.FloatDistribution(k.low, k.high, log=k.log)
