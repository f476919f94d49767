"""A training from the first step to the pilot: updates, evaluations in the simulator, checkpoints.

The best pilot of all evaluations is kept.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np
from msgspec import structs

from controllers.learned.pilot import About, Pilot, load_pilot, pilot_bytes
from quadsim.dynamics.quadrotor import Control, ModelParams
from quadsim.learn.checkpoint import Checkpoint, Evaluation, checkpoint_bytes, read_checkpoint
from quadsim.learn.ppo_config import PPOConfig, crash_share
from quadsim.learn.task import LearningTask
from quadsim.race.events import flown_laps
from quadsim.record.whole_files import write_whole
from quadsim.spec.build import flight_frames
from quadsim.spec.spec import Spec

if TYPE_CHECKING:
    from quadsim.learn.ppo import Learner

EVALUATED = "evaluated"  # key of a pilot's evaluation in the record of its training
EVALUATION_SEED = 10_000  # the first of those that evaluations fly; a comparison's seeds begin at 0


@dataclass(frozen=True)
class Training:
    """A training as it was asked for."""

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
        """The file of the checkpoint, beside the pilot."""
        return self.out.with_suffix(".checkpoint.npz")

    @property
    def identity(self) -> dict[str, Any]:
        """The settings that decide the training's numbers, except its steps, which may grow.

        The vehicle counts by its numbers, as a file of the same name may have changed.
        """
        task = self.task
        return {
            "courses": [course.text for course in task.courses],
            "vehicle": asdict(task.vehicle),
            "model": asdict(ModelParams.of(task.vehicle)),
            "seed": self.seed,
            "laps": task.laps,
            "dt": task.dt,
            "start": task.start,
            "randomize": task.randomize,
            "time_limit": task.time_limit,
            "noise": task.noise,
            "rewards": asdict(task.rewards),
            "ppo": asdict(self.config),
        }


class Flown(NamedTuple):
    """The races of an evaluation."""

    finished: float  # share of the races
    lap: float  # mean of those that finished [s]; 0 without one
    gates: float  # mean share of the gates passed


class Score(NamedTuple):
    """The quality of a pilot in its evaluation. A greater score is better, field by field."""

    finished: float  # share of the races
    speed: float  # negative lap time [s]; 0 without a finished race
    gates: float  # share of the gates

    @classmethod
    def of(cls, row: Evaluation) -> Score:
        """Return the score of an evaluation in the history."""
        speed = -row["lap"] if row["finished"] else 0.0
        return cls(row["finished"], speed, row["gates"])


def train(
    training: Training, report: Callable[[Evaluation], None] = lambda row: None
) -> list[Evaluation]:
    """Learn, evaluate and keep the best pilot.

    If there is a checkpoint beside the pilot, the training continues from it.

    Args:
        training: the settings, and the files to write.
        report: function called after each evaluation with its row of the history.

    Returns:
        A row for each evaluation: steps, reward per second, finished, lap, gates, seconds.

    Raises:
        FileError: the checkpoint is damaged or of another training, or the file of the pilot is
            something else.
        ImportError: stable-baselines3 is not installed.
        RunError: a file cannot be written.
    """
    # PyTorch is an extra, and takes seconds to load.
    from quadsim.learn.ppo import Learner

    config = training.config
    learner = Learner(training.task, config, training.seed)
    history: list[Evaluation] = []
    # Beside no checkpoint, a pilot is one of another training, which this one replaces.
    kept = load_pilot(training.out) if training.out.exists() else None
    best = None
    if training.checkpoint.exists():
        found = read_checkpoint(training.checkpoint, learner.parameters(), training.identity)
        learner.restore(found.parameters, found.steps_done)
        history = found.history
        best = best_score(history, kept)
    seconds_before = history[-1]["seconds"] if history else 0.0
    began = perf_counter()
    reward = history[-1]["reward"] if history else 0.0
    rewards: list[float] = []
    while learner.steps_done < training.steps:
        done = learner.steps_done / training.steps
        learner.rate = config.first_rate + done * (config.last_rate - config.first_rate)
        reward = learner.learn(crash_share(reward, config))
        rewards.append(reward)
        due = (len(history) + 1) * training.every * training.steps
        if learner.steps_done < min(due, training.steps):
            continue

        pilot = pilot_of(learner, training)
        flown = evaluate(pilot, training.task, training.flights)
        row = Evaluation(
            steps=learner.steps_done,
            reward=float(np.mean(rewards)),
            **flown._asdict(),
            seconds=seconds_before + perf_counter() - began,
        )
        # The pilot is written before the checkpoint: a training that is killed between the two
        # flies this evaluation again, and keeps the better one.
        if best is None or Score.of(row) >= best:
            best = Score.of(row)
            record = {EVALUATED: row, "evaluations": len(history) + 1}
            about = structs.replace(pilot.about, training=pilot.about.training | record)
            write_whole(training.out, pilot_bytes(pilot.weights, about))
        history.append(row)
        rewards = []
        checkpoint = Checkpoint(learner.parameters(), learner.steps_done, history)
        write_whole(training.checkpoint, checkpoint_bytes(checkpoint, training.identity))
        report(row)
    return history


def best_score(history: Sequence[Evaluation], kept: Pilot | None) -> Score | None:
    """Return the score that a pilot needs to be kept, None where any will do.

    The pilot on the disk may be newer than the checkpoint, and it may be gone.

    Args:
        history: the evaluations up to the checkpoint.
        kept: the pilot on the disk.
    """
    if kept is None:
        return None
    scores = [Score.of(row) for row in history]
    with suppress(msgspec.ValidationError):
        evaluated = kept.about.training.get(EVALUATED)
        scores.append(Score.of(msgspec.convert(evaluated, Evaluation)))
    return max(scores)


def pilot_of(learner: Learner, training: Training) -> Pilot:
    """Return the policy's mean as a pilot."""
    task = training.task
    system = task.system
    about = About(
        vehicle=task.vehicle.name,
        dt=task.dt,
        hold=training.config.hold,
        low=Control(*system.low),
        high=Control(*system.high),
        course=", ".join(course.name for course in task.courses),
        vehicle_sha256=sha256(json.dumps(asdict(task.vehicle)).encode()).hexdigest(),
        training={
            "seed": training.seed,
            "steps": learner.steps_done,
            "command": training.command,
            "rewards": asdict(task.rewards),
            "ppo": asdict(training.config),
        },
    )
    return Pilot(training.out.stem, about, tuple(learner.pilot_weights()))


def evaluate(pilot: Pilot, task: LearningTask, flights: int, seed: int = EVALUATION_SEED) -> Flown:
    """Fly races in the simulator with rotors, gusts and the referee."""
    finished: list[bool] = []
    laps: list[float] = []
    gates: list[float] = []
    for number in range(flights):
        course = task.courses[number % len(task.courses)]
        spec = Spec.of(
            course,
            vehicle=task.vehicle,
            pilot=pilot,
            laps=task.laps[task.courses.index(course)],
            seed=seed + number,
            randomize=task.randomize,
            dt=task.dt,
        )
        frames = list(flight_frames(spec))
        done = frames[-1].outcome == "finished"
        finished.append(done)
        gates.append(frames[-1].passed / (len(course.gates) * spec.laps))
        if done:
            events = [event for frame in frames for event in frame.events]
            laps.extend(flown_laps(events, spec.laps))
    return Flown(
        finished=float(np.mean(finished)),
        lap=float(np.mean(laps)) if laps else 0.0,
        gates=float(np.mean(gates)),
    )
