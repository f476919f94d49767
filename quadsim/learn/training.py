"""Train a pilot: policy updates, evaluations in the simulator, checkpoints.

The best pilot of all evaluations is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from math import floor
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np
from msgspec import structs

from quadsim.config.build import flight_frames
from quadsim.config.spec import Spec
from quadsim.controllers.learned.pilot import About, Pilot, load_pilot, pilot_bytes
from quadsim.controllers.learned.policy import vehicle_digest
from quadsim.dynamics.quadrotor import Control, ModelParams
from quadsim.learn.checkpoint import Checkpoint, Evaluation, checkpoint_bytes, read_checkpoint
from quadsim.learn.ppo_config import PPOConfig
from quadsim.learn.task import LearningTask
from quadsim.racing.events import flown_laps
from quadsim.record.whole_files import write_whole

if TYPE_CHECKING:
    from quadsim.learn.ppo import Learner

EVALUATED = "evaluated"  # key of a pilot's evaluation in the record of its training
EVALUATION_SEED = 10_000  # first seed of an evaluation's flights; comparisons begin at seed 0


@dataclass(frozen=True)
class Training:
    """The settings of a training."""

    task: LearningTask
    config: PPOConfig
    seed: int
    steps: int  # total steps of the environments
    out: Path  # file of the pilot
    every: float = 0.05  # share of the training between two evaluations
    flights: int = 4  # flights of an evaluation in the second half; a quarter of it before
    minutes: float | None = None  # time limit of the training, regardless of its steps
    command: str = ""  # command line of the training

    @property
    def checkpoint(self) -> Path:
        """The path of the checkpoint, in the folder of the pilot."""
        return self.out.with_suffix(".checkpoint.npz")

    @property
    def identity(self) -> dict[str, Any]:
        """The settings that decide the training's numbers, except its length.

        The vehicle is identified by its numbers, as a file of the same name may have changed.
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


class Progress(NamedTuple):
    """The progress of a training."""

    steps: int  # of the environments so far
    share: float  # of the training that is done
    rate: float  # steps per second, evaluations included
    left: float  # time until the end at this rate [s]


class EvaluatedRaces(NamedTuple):
    """The races of an evaluation."""

    finished: float  # share of the races
    lap: float  # mean lap time of finished races [s]; 0 without one
    gates: float  # mean share of the gates passed


class Score(NamedTuple):
    """The quality of a pilot in an evaluation, compared field by field; greater is better.

    The number of flights comes first, as the mean of many flights is more reliable than the mean of
    a few.
    """

    flights: int
    finished: float  # share of the races
    speed: float  # negative lap time [s]; 0 without a finished race
    gates: float  # share of the gates

    @classmethod
    def of(cls, row: Evaluation) -> Score:
        """Return the score of an evaluation in the history."""
        speed = -row["lap"] if row["finished"] else 0.0
        return cls(row["flights"], row["finished"], speed, row["gates"])


def train(
    training: Training,
    report: Callable[[Evaluation], None] = lambda row: None,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> list[Evaluation]:
    """Train a pilot, keep the best one, and return the history of its evaluations.

    If there is a checkpoint beside the pilot, the training continues from it.

    Args:
        training: the settings, and the files to write.
        report: function called after each evaluation with its row of the history.
        progress: function called after each update.

    Returns:
        A row for each evaluation: steps, reward per second, flights, finished, lap, gates, seconds.

    Raises:
        FileError: the checkpoint is damaged or belongs to a different training, or the pilot's file
            is not a pilot.
        ImportError: stable-baselines3 is not installed.
        RunError: a file cannot be written.
    """
    # PyTorch is an extra, and takes seconds to load.
    from quadsim.learn.ppo import Learner

    config = training.config
    learner = Learner(training.task, config, training.seed)
    history: list[Evaluation] = []
    # Without a checkpoint, the pilot on the disk belongs to a different training and is replaced.
    kept = load_pilot(training.out) if training.out.exists() else None
    best = None
    if training.checkpoint.exists():
        found = read_checkpoint(training.checkpoint, learner.parameters(), training.identity)
        learner.restore(found.parameters, found.steps_done)
        history = found.history
        best = best_score(history, kept)
    clock = Clock(training, learner.steps_done, history[-1]["seconds"] if history else 0.0)
    rewards: list[float] = []
    share = clock.share(learner.steps_done)
    evaluated = share
    while share < 1.0:
        learner.rate = learning_rate(share, config)
        rewards.append(learner.learn())
        share = clock.share(learner.steps_done)
        progress(clock.progress(learner.steps_done))
        if share < min(evaluated + training.every, 1.0):
            continue

        evaluated = training.every * floor(share / training.every)
        pilot = pilot_of(learner, training)
        flights = training.flights if share > 0.5 else -(-training.flights // 4)
        flown = evaluate(pilot, training.task, flights)
        row = Evaluation(
            steps=learner.steps_done,
            reward=float(np.mean(rewards)),
            flights=flights,
            **flown._asdict(),
            seconds=clock.seconds(),
        )
        # The pilot is written before the checkpoint: a training that is killed in between repeats
        # this evaluation, and keeps the better pilot.
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
        share = clock.share(learner.steps_done)
    return history


class Clock:
    """The elapsed time and share of a training.

    Args:
        training: the training.
        steps: steps before this process.
        seconds: training time before this process [s].
    """

    def __init__(self, training: Training, steps: int, seconds: float):
        self._training = training
        self._steps_before = steps
        self._seconds_before = seconds
        self._began = perf_counter()

    def seconds(self) -> float:
        """Return the time of training so far [s]."""
        return self._seconds_before + perf_counter() - self._began

    def share(self, steps: int) -> float:
        """Return the elapsed share of the training, by steps or by time, whichever is greater."""
        minutes = self._training.minutes
        of_time = self.seconds() / (60.0 * minutes) if minutes else 0.0
        return max(steps / self._training.steps, of_time)

    def progress(self, steps: int) -> Progress:
        """Return the progress after this number of steps."""
        rate = (steps - self._steps_before) / max(perf_counter() - self._began, 1e-9)
        left = max(self._training.steps - steps, 0) / max(rate, 1e-9)
        if self._training.minutes:
            left = min(left, max(60.0 * self._training.minutes - self.seconds(), 0.0))
        return Progress(steps, min(self.share(steps), 1.0), rate, left)


def learning_rate(share: float, config: PPOConfig) -> float:
    """Return the learning rate at this share of a training."""
    return config.first_rate + min(share, 1.0) * (config.last_rate - config.first_rate)


def best_score(history: Sequence[Evaluation], kept: Pilot | None) -> Score | None:
    """Return the score that a new pilot has to exceed, None if there is none.

    The stored pilot may be newer than the checkpoint, or missing.

    Args:
        history: the evaluations up to the checkpoint.
        kept: the stored pilot, None if there is none.
    """
    if kept is None:
        return None
    scores = [Score.of(row) for row in history]
    with suppress(msgspec.ValidationError):
        evaluated = kept.about.training.get(EVALUATED)
        scores.append(Score.of(msgspec.convert(evaluated, Evaluation)))
    return max(scores)


def pilot_of(learner: Learner, training: Training) -> Pilot:
    """Return the mean of the policy as a pilot."""
    task = training.task
    system = task.system
    about = About(
        vehicle=task.vehicle.name,
        dt=task.dt,
        hold=training.config.hold,
        low=Control(*system.low),
        high=Control(*system.high),
        course=", ".join(course.name for course in task.courses),
        activation="relu",
        output="clip",
        vehicle_sha256=vehicle_digest(task.vehicle),
        training={
            "seed": training.seed,
            "steps": learner.steps_done,
            "command": training.command,
            "rewards": asdict(task.rewards),
            "ppo": asdict(training.config),
        },
    )
    return Pilot(training.out.stem, about, tuple(learner.pilot_weights()))


def evaluate(
    pilot: Pilot, task: LearningTask, flights: int, seed: int = EVALUATION_SEED
) -> EvaluatedRaces:
    """Return races of a pilot, flown in the simulator with rotors, gusts and the referee."""
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
    return EvaluatedRaces(
        finished=float(np.mean(finished)),
        lap=float(np.mean(laps)) if laps else 0.0,
        gates=float(np.mean(gates)),
    )
