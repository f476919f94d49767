"""The search of `race tune`: optuna proposes parameters and learns from their flights.

Trials are kept in the campaign's own SQLite file, in tables that optuna makes. Each of its
transactions is there whole or not at all, so a kill at any moment loses no trial that has finished.
This module needs the extra `tune`.
"""

from __future__ import annotations

import sqlite3
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Self

import msgspec
import optuna
from optuna.distributions import BaseDistribution, FloatDistribution, IntDistribution
from optuna.trial import FrozenTrial, Trial, TrialState

from quadsim.campaign.run.database import BUSY_TIMEOUT
from quadsim.campaign.tune.parameters import Parameter
from quadsim.files.locks import in_turn
from quadsim.record.run import RunError

STARTUP = 12  # trials drawn at random before optuna models the good ones
NOT_FLOWN = "not_flown"  # attribute of a trial whose attempts were lost
QUEUED = "queued"  # attribute of a trial that was not proposed: its parameters
STATS = "stats"  # attribute of a trial: its TrialStats

optuna.logging.set_verbosity(optuna.logging.WARNING)
warnings.filterwarnings("ignore", category=optuna.exceptions.ExperimentalWarning)


@dataclass(frozen=True)
class TrialStats:
    """The statistics of a trial besides the value of the objective."""

    lap: float | None  # [s]; None: no attempt finished
    finished: int  # attempts
    thrust_tv: float  # [m/s^2/s]


@dataclass(frozen=True)
class FlownTrial:
    """A trial that has been flown."""

    number: int
    parameters: dict[str, int | float]
    value: float  # of the objective; less is better
    stats: TrialStats


class Search:
    """A search that continues where the campaign's file holds one of its name: `with Search(...)`.

    One process at a time may ask and tell; several searches share one file.
    """

    def __init__(self, campaign: Path, name: str, parameters: Sequence[Parameter]):
        """Open the search, or begin it with the parameters' own values.

        Args:
            campaign: the SQLite file.
            name: name that distinguishes this search from others in the file.
            parameters: the parameters to search.

        Raises:
            RunError: the file cannot be read or written.
        """
        self._campaign = campaign
        self._space = {p.name: _distribution(p) for p in parameters}
        with self._search_errors():
            campaign.parent.mkdir(parents=True, exist_ok=True)
            # A file's name may hold what means something in a URL, so that it is not part of one.
            connect = partial(sqlite3.connect, campaign, timeout=BUSY_TIMEOUT)
            # One process at a time makes the tables.
            with in_turn(campaign.parent):
                self._storage = optuna.storages.RDBStorage(
                    "sqlite:///campaign", engine_kwargs={"creator": connect}
                )
                self._study = optuna.create_study(
                    storage=self._storage, study_name=name, load_if_exists=True
                )
            self._reopen()
            if not self._asked and not self._trials(TrialState.WAITING):
                self._enqueue({p.name: p.start for p in parameters})

    def _reopen(self) -> None:
        """Close the trials that a kill left open, and put them in the queue again.

        A kill at any moment in here neither loses a trial nor queues it twice. A trial that was
        killed while it was proposed is not queued: it is proposed again, from the same seed.
        """
        queued = [trial.user_attrs[QUEUED] for trial in self._trials(TrialState.WAITING)]
        for trial in self._trials(TrialState.RUNNING):
            parameters = trial.user_attrs.get(QUEUED, trial.params)
            if parameters.keys() == self._space.keys() and parameters not in queued:
                self._enqueue(parameters)
            self._study.tell(trial.number, state=TrialState.FAIL)

    def _enqueue(self, parameters: dict[str, float]) -> None:
        """Let these parameters be the next trial."""
        self._study.enqueue_trial(parameters, user_attrs={QUEUED: parameters})

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._storage.remove_session()
        self._storage.engine.dispose()

    @property
    def done(self) -> int:
        """Return the number of trials that have been flown. Raises RunError."""
        with self._search_errors():
            return len(self._trials(TrialState.COMPLETE))

    @property
    def _asked(self) -> int:
        """Return the number of trials that are flown or cannot be flown.

        Trials that a kill left open do not count.
        """
        lost = [t for t in self._trials(TrialState.FAIL) if NOT_FLOWN in t.user_attrs]
        return len(self._trials(TrialState.COMPLETE, TrialState.RUNNING)) + len(lost)

    def ask(self, number: int) -> list[Trial]:
        """Return a number of trials to fly. Raises RunError."""
        with self._search_errors():
            return [self._ask() for _ in range(number)]

    def _ask(self) -> Trial:
        # Each proposal has a seed of its own, so that it depends on the trials so far and not on
        # where the search was stopped.
        self._study.sampler = optuna.samplers.TPESampler(
            multivariate=True, constant_liar=True, n_startup_trials=STARTUP, seed=self._asked
        )
        return self._study.ask(self._space)

    def tell(self, trial: Trial, value: float, stats: TrialStats) -> None:
        """Store the result of a trial.

        Args:
            trial: one that `ask` returned.
            value: value of the objective; less is better.
            stats: its other statistics.

        Raises:
            RunError: the file cannot be written.
        """
        with self._search_errors():
            trial.set_user_attr(STATS, asdict(stats))
            self._study.tell(trial, value)

    def give_up(self, trial: Trial) -> None:
        """Note that a trial cannot be flown. Raises RunError."""
        with self._search_errors():
            trial.set_user_attr(NOT_FLOWN, True)
            self._study.tell(trial, state=TrialState.FAIL)

    def flown(self) -> list[FlownTrial]:
        """Return the trials that have been flown, in their order. Raises RunError."""
        with self._search_errors():
            return [_flown(trial) for trial in self._trials(TrialState.COMPLETE)]

    def best(self, number: int) -> list[FlownTrial]:
        """Return the best trials, best first; of equal parameters the first trial alone."""
        ranked = sorted(self.flown(), key=lambda t: t.value)
        found: list[FlownTrial] = []
        for trial in ranked:
            if all(trial.parameters != other.parameters for other in found):
                found.append(trial)
        return found[:number]

    def _trials(self, *states: TrialState) -> list[FrozenTrial]:
        return self._study.get_trials(deepcopy=False, states=states)

    @contextmanager
    def _search_errors(self) -> Iterator[None]:
        """Turn the errors of optuna and SQLAlchemy into a RunError.

        A table that something else has changed fails in a dozen ways.
        """
        try:
            yield
        except RunError:
            raise
        except Exception as error:
            reason: BaseException = error
            while reason.__cause__ is not None:
                reason = reason.__cause__
            first = str(reason).partition("\n")[0]
            raise RunError(
                f"{self._campaign}: cannot keep the search here: {type(reason).__name__}: {first}"
            ) from error


def _flown(trial: FrozenTrial) -> FlownTrial:
    """Return a trial, whose types are checked as the file may be damaged."""
    found = {
        "number": trial.number,
        "parameters": trial.params,
        "value": trial.value,
        "stats": trial.user_attrs[STATS],
    }
    return msgspec.convert(found, FlownTrial)


def _distribution(p: Parameter) -> BaseDistribution:
    if p.step:
        return IntDistribution(int(p.low), int(p.high), step=p.step)
    return FloatDistribution(p.low, p.high, log=p.log)
