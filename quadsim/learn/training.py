"""A training from the first step to the pilot: updates, flights that evaluate, checkpoints; the
best pilot is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from controllers.learned.pilot import LAYERS, About, Pilot, pilot_bytes
from quadsim.files.atomic import replace_file
from quadsim.learn.checkpoint import checkpoint_bytes, restore
from quadsim.learn.ppo import PPO, PPOConfig
from quadsim.learn.task import LearningTask
from quadsim.race.events import flown_laps
from quadsim.spec.build import flight_frames
from quadsim.spec.spec import Spec

EVALUATION_SEED = 10_000  # the first of those that evaluations fly; a comparison's seeds begin at 0


@dataclass(frozen=True)
class Training:
    """What is asked for."""

    task: LearningTask
    config: PPOConfig
    seed: int
    steps: int  # of the environments
    out: Path  # of the pilot
    every: float = 0.05  # share of the steps between two evaluations
    flights: int = 4  # of an evaluation
    command: str = ""  # that began it

    @property
    def checkpoint(self) -> Path:
        return self.out.with_suffix(".checkpoint.npz")

    @property
    def identity(self) -> dict[str, Any]:
        """All that decides the numbers; steps may grow."""
        t = self.task
        named = {
            "courses": [c.text for c in t.courses],
            "vehicle": t.vehicle.name,
            "seed": self.seed,
        }
        of_task = {
            k: getattr(t, k) for k in ("laps", "dt", "start", "randomize", "time_limit", "noise")
        }
        return named | of_task | {"rewards": asdict(t.rewards)} | {"ppo": asdict(self.config)}


def train(training: Training, say: Callable[[dict], None] = lambda row: None) -> list[dict]:
    """Learn, evaluate and keep the best pilot; what happened, an entry for each evaluation.

    Goes on from the checkpoint beside the pilot, where there is one of the same settings. Raises
    FileError, OSError.
    """
    ppo = PPO(training.task, training.config, training.seed)
    history: list[dict] = []
    if training.checkpoint.exists():
        history = restore(ppo, training.checkpoint, training.identity)
    began = perf_counter() - (history[-1]["seconds"] if history else 0.0)
    seen: list[dict] = []
    while ppo.steps_done < training.steps:
        seen.append(ppo.learn())
        due = (len(history) + 1) * training.every * training.steps
        if ppo.steps_done < min(due, training.steps):
            continue
        row = {k: float(np.mean([s[k] for s in seen])) for k in seen[0]} | {"steps": ppo.steps_done}
        pilot = pilot_of(ppo, training)
        row |= evaluate(pilot, training.task, training.flights) | {
            "seconds": perf_counter() - began
        }
        if not history or score(row) >= max(map(score, history)):
            replace_file(training.out, pilot_bytes(pilot.weights, told(pilot, history, row)))
        history.append(row)
        seen = []
        replace_file(training.checkpoint, checkpoint_bytes(ppo, training.identity, history))
        say(row)
    return history


def told(pilot: Pilot, history: list[dict], row: dict) -> About:
    """What the file says, with the evaluation that chose it."""
    return replace(
        pilot.about,
        training=pilot.about.training | {"evaluated": row, "evaluations": len(history) + 1},
    )


def score(row: dict) -> tuple[float, float, float]:
    """What of two evaluations is better: more finished, then faster, else more gates passed."""
    return row["finished"], -row["lap"] if row["finished"] else 0.0, row["gates"]


def pilot_of(ppo: PPO, training: Training) -> Pilot:
    """The policy's mean as a pilot."""
    t, system = training.task, training.task.system
    about = About(
        vehicle=t.vehicle.name,
        dt=t.dt,
        hold=training.config.hold,
        low=system.low,
        high=system.high,
        course=", ".join(c.name for c in t.courses),
        training={
            "seed": training.seed,
            "steps": ppo.steps_done,
            "command": training.command,
            "rewards": asdict(t.rewards),
            "ppo": asdict(training.config),
        },
    )
    return Pilot(training.out.stem, about, tuple(w.copy() for w in ppo.policy[:LAYERS]))


def evaluate(
    pilot: Pilot, task: LearningTask, flights: int, seed: int = EVALUATION_SEED
) -> dict[str, float]:
    """Races in the simulator with rotors, gusts and the referee: share finished, mean lap [s],
    share of the gates."""
    finished, laps, gates = [], [], []
    for number in range(flights):
        course = task.courses[number % len(task.courses)]
        spec = replace(_spec(course, task, seed + number), pilot=pilot, sampler="pilot")
        frames = list(flight_frames(spec))
        done = frames[-1].outcome == "finished"
        finished.append(done)
        gates.append(frames[-1].passed / (len(course.gates) * spec.laps))
        laps += flown_laps([e for f in frames for e in f.events], spec.laps) if done else []
    return {
        "finished": float(np.mean(finished)),
        "lap": float(np.mean(laps)) if laps else 0.0,
        "gates": float(np.mean(gates)),
    }


def _spec(course: Any, task: LearningTask, seed: int) -> Spec:
    laps = task.laps[task.courses.index(course)]
    spec = Spec.of(course, seed=seed, randomize=task.randomize, laps=laps, dt=task.dt)
    return replace(spec, vehicle=task.vehicle)


def rows_of(history: list[dict]) -> Iterator[tuple[float, ...]]:
    """(million steps, reward [1/s], share finished, lap [s], share of the gates) of each
    evaluation."""
    for row in history:
        yield (
            row["steps"] / 1e6,
            row["reward"],
            row["finished"],
            row["lap"] or float("nan"),
            row["gates"],
        )
