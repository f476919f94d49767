"""Flights with parts of one's own that break in the middle, or that are no parts at all."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np

import quadsim
from quadsim.config.build_plant import start_of
from quadsim.controllers.costs import Cost
from quadsim.controllers.plan import PlanStats
from quadsim.dynamics.quadrotor import quadrotor
from quadsim.physics.plant import PlantState
from quadsim.racing.events import Event
from tests.fuzz.harness import Case
from tests.fuzz.junk import junk, reported

BUDGET: dict[str, Any] = {"samples": 64, "horizon": 20, "iterations": 1, "laps": 1, "timeout": 0.05}
REST = np.array([0.0, 0.0, 0.0, 9.81])
STATS = PlanStats(cost=0.0, ess=1.0, temperature=1.0)


class Answers:
    """Answers that are right, until one of them is replaced."""

    def __init__(self, at: int = -1, wrong: object = None):
        """Give the wrong answer number `at`."""
        self.at = at
        self.wrong = wrong
        self.asked = 0

    def of(self, right: object) -> Any:
        """Return the right answer, or the wrong one."""
        self.asked += 1
        return self.wrong if self.asked - 1 == self.at else right


class AnyPlant:
    """The planner's model as the world."""

    def __init__(self, answers: Answers, changed: str, spec: Any):
        self.dt = spec.plant_dt
        self.answers = answers
        self.changed = changed
        self.system = quadrotor(spec.model, self.dt)
        self.state = PlantState(0.0, start_of(spec), ())

    def step(self, u: Any) -> Any:
        x = self.system.next(self.state.x, u)
        after = PlantState(self.state.t + self.dt, x, ())
        if self.changed == "state":
            self.state = self.answers.of(after)
        else:
            value = self.answers.of(getattr(after, self.changed))
            self.state = replace(after, **{self.changed: value})
        return self.state

    def close(self) -> None:
        pass


class AnyController:
    """It hovers."""

    rest = REST

    def __init__(self, answers: Answers, changed: str):
        self.answers = answers
        self.changed = changed

    def control(self, estimate: Any) -> Any:
        if self.changed == "control":
            return self.answers.of(REST), STATS
        return self.answers.of((REST, STATS))


class AnyLaw:
    """It hovers, and has no rest."""

    def __init__(self, answers: Answers):
        self.answers = answers

    def control(self, x: Any) -> Any:
        return self.answers.of(REST)


class AnyReferee:
    """It lets the vehicle fly."""

    outcome: Any = None

    def __init__(self, answers: Answers, changed: str):
        self.passed: Any = 0
        self.lap: Any = 1
        self.next_gate: Any = 0
        self.answers = answers
        self.changed = changed

    def observe(self, t0: Any, p0: Any, t1: Any, p1: Any, contacts: Any = ()) -> Any:
        events = [Event(t1, "pass", 1, 1, (0.0, 0.0), 0.0, p1)] if t0 == 0 else []
        if self.changed == "observe":
            return self.answers.of(events)
        setattr(self, self.changed, self.answers.of(getattr(self, self.changed)))
        return events


class AnySampler:
    """White noise."""

    def __init__(self, answers: Answers, shape: int | None):
        self.answers = answers
        self.shape = shape

    def sample(self, rng: Any, samples: int, horizon: int, controls: int) -> Any:
        wanted = (samples, horizon, controls)
        if self.shape is not None:
            wanted = (*wanted[: self.shape], *wanted[self.shape + 1 :])
        return self.answers.of(rng.standard_normal(wanted))


class Maker:
    """Makes a part by a call or by a method."""

    def __init__(self, make: Callable[[Any], Any]):
        self.make = make

    def __call__(self, spec: Any) -> Any:
        return self.make(spec)

    def bound(self, spec: Any) -> Any:
        return self.make(spec)


def own_parts(rng: random.Random) -> Case:
    """Return a flight with a part that gives a wrong answer, or with a wrong object as a part."""
    role = rng.choice(("plant", "controller", "referee", "sampler", "cost", "terms"))
    wrong = junk(rng)
    answers = Answers(at=rng.choice((0, 0, 1, 3, 7)), wrong=wrong)
    part: Any
    if rng.random() < 0.2:
        part, label = wrong, "as it is"
    else:
        part, label = _part(role, answers, rng)
    deadline = {"deadline_ms": 5.0} if rng.random() < 0.1 else {}
    fly = partial(quadsim.fly, "figure8", **BUDGET, **deadline, **{role: part})
    return Case(
        "own_parts",
        f"{role}: {label}: {wrong!r:.60} in answer {answers.at} {deadline}",
        (),
        call=partial(reported, fly),
        codes=frozenset({0, 2}),
    )


def _part(role: str, answers: Answers, rng: random.Random) -> tuple[Any, str]:
    """Return a part that gives these answers, or a maker of one, and its label."""
    make: Callable[[Any], Any]
    match role:
        case "sampler":
            shape = rng.choice((None, None, 0, 1, 2))
            return AnySampler(answers, shape), f"sample without axis {shape}"
        case "cost":
            name = rng.choice([f.name for f in fields(Cost)])
            if rng.random() < 0.3:
                return lambda cost: answers.wrong, "a function of the cost"
            return lambda cost: replace(cost, **{name: answers.wrong}), f"field {name}"
        case "terms":
            place = rng.randrange(3)
            pair: list[Any] = [lambda x, x_next, u, gate, p: answers.wrong, 1.0]
            if place < 2:
                pair[place] = answers.wrong
            return [tuple(pair)], f"place {place} of a term"
        case "plant":
            changed = rng.choice(("state", "t", "x", "contacts"))
            make = partial(AnyPlant, answers, changed)
        case "controller":
            changed = rng.choice(("control", "pair", "law"))

            def make(spec: Any) -> Any:
                is_law = changed == "law"
                return AnyLaw(answers) if is_law else AnyController(answers, changed)
        case _:
            changed = rng.choice(("observe", "outcome", "passed", "lap", "next_gate"))

            def make(spec: Any) -> Any:
                return AnyReferee(answers, changed)

    form = rng.choice(("function", "partial", "callable", "bound"))
    forms = {"function": lambda spec: make(spec), "partial": partial(make)}
    forms |= {"callable": Maker(make), "bound": Maker(make).bound}
    return forms[form], f"{changed} of a {form}"
