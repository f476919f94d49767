"""`quadsim/RacingBullet-v0`: the task of Racing-v0 in PyBullet, for evaluation.

The simulation has rotors, control allocation, gusts and the referee.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.error import ResetNeeded

from quadsim.config.build import build
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.costs.race import progress
from quadsim.controllers.learned.observation import command, gate_rows, normalised, observe
from quadsim.dynamics.quadrotor import POSE, Control
from quadsim.learn.render import RENDER_MODES, Renderer, ViewerFactory
from quadsim.learn.reward import reward as reward_of
from quadsim.learn.spaces import (
    ACTIONS,
    action_space,
    checked_actions,
    checked_reset,
    observation_space,
)
from quadsim.learn.task import task
from quadsim.racing.flight import apply_control, whole_multiple

LARGEST_SEED = 10**9  # of a flight; a larger seed of an environment draws the flight's seed


class RacingBulletEnv(Env):
    """A race in the simulation of `race fly`.

    Rewards are as in Racing-v0, but without the clearance term, which is not measured here.

    Args:
        render_mode, viewer: see RacingVectorEnv.
        plant: "bullet" or "rigid"; None: bullet if PyBullet is installed.
        settings: course, vehicle, laps, reward, dt, randomize, time_limit; see
            quadsim.learn.task.task. Only one course may be given.

    Raises:
        SettingError, FileError: a value is invalid (both are ValueError).
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 100}  # noqa: RUF012

    def __init__(
        self,
        render_mode: str | None = None,
        viewer: ViewerFactory | None = None,
        plant: str | None = None,
        **settings: Any,
    ):
        self.task = task(**settings)
        self.render_mode = render_mode
        if len(self.task.courses) != 1:
            raise SettingError("course", f"expected one, got {len(self.task.courses)}")
        if self.task.start != "standing":
            problem = f"expected standing, got {self.task.start}: elsewhere Racing-v0 starts"
            raise SettingError("start", problem)
        (course,) = self.task.courses
        (laps,) = self.task.laps
        self._renderer = Renderer(render_mode, viewer, course, 1, self.task.dt)
        self._spec = self._make_spec(plant)
        self._system = self.task.system
        self._cost = self.task.cost(0)
        self._gates = gate_rows(course, laps)
        self._plant: Any = None
        self.observation_space = observation_space()
        self.action_space = action_space()

    def _make_spec(self, plant: str | None) -> Spec:
        """Return the specification of the flight, without its seed."""
        asked = {
            "laps": self.task.laps[0],
            "randomize": self.task.randomize,
            "timeout": self.task.time_limit,
            "dt": self.task.dt,
            "plant": plant,
        }
        given = {name: value for name, value in asked.items() if value is not None}
        spec = Spec.of(self.task.courses[0], controller=_NoController(), **given)
        return replace(spec, vehicle=self.task.vehicle)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode and return its first observation (38,).

        Args:
            seed: seed of the randomization, 0 to 2^63 - 1.
            options: not used; wrappers may pass any.

        Raises:
            SettingError: the seed is not an integer, or out of range.
        """
        seed = checked_reset(seed, options)
        super().reset(seed=seed)
        self._close_plant()
        number = seed
        if seed is None or seed > LARGEST_SEED:
            number = int(self.np_random.integers(LARGEST_SEED))
        parts = build(replace(self._spec, seed=number))
        self._plant = parts.plant
        self._referee = parts.referee
        self._last = normalised(self._system.rest, self._system.low, self._system.high)
        self._way = self._way_left()
        self._renderer.update(self._state_rows)
        return self._observed(), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Fly one step of dt under an action (4,); see RacingVectorEnv.step.

        `crashed` in the info is the referee's decision.
        """
        chosen = np.clip(checked_actions(action, (ACTIONS,)), -1, 1).astype(float)
        if self._plant is None:
            raise ResetNeeded("RacingBullet-v0: step() before reset()")
        if self._referee.outcome is not None:
            raise ResetNeeded("RacingBullet-v0: the episode has ended: call reset()")
        u = command(chosen, self._system.low, self._system.high)
        plant_steps = whole_multiple(self.task.dt, self._plant.dt)
        until = self._plant.state.t + plant_steps * self._plant.dt
        passed_before = self._referee.passed
        events = apply_control(self._plant, self._referee, tuple(u.tolist()), until)

        outcome = self._referee.outcome
        passed = self._referee.passed - passed_before
        crashed = outcome in ("crashed", "stuck")
        finished = outcome == "finished"
        way_before = self._way
        self._way = self._way_left()
        paid = reward_of(
            progress=way_before - self._way,
            clearance=0.0,
            crashed=float(crashed),
            reached=float(passed),
            action=Control(*chosen),
            last=Control(*self._last),
            p=self.task.rewards.params,
        )
        self._last = chosen
        self._renderer.update(self._state_rows)
        info = {
            "passed": bool(passed),
            "gates": self._referee.passed,
            "lap": self._referee.lap,
            "time": self._plant.state.t,
            "crashed": crashed,
            "finished": finished,
            "events": [event.kind for event in events],
        }
        return self._observed(), float(paid), crashed or finished, outcome == "timeout", info

    def render(self) -> np.ndarray | None:
        """Return a picture from above if the mode is rgb_array.  (height, width, 3) uint8"""
        return self._renderer.picture(self._state_rows())

    def close(self) -> None:
        """Close the viewer and the plant."""
        self._renderer.close()
        self._close_plant()

    def _observed(self) -> np.ndarray:
        """Return the observation.  (38,)"""
        return observe(self._plant.state.x, self._gates[self._referee.passed], self._last)

    def _way_left(self) -> float:
        """Return the remaining distance to the finish, as in the racing cost [m]."""
        x = self._plant.state.x
        targets = self._cost.targets
        row = targets[min(self._referee.passed, len(targets) - 1)]
        return float(progress(x, x, self._system.rest, self._cost.row(*row), self._cost.params))

    def _state_rows(self) -> np.ndarray:
        """Return position, velocity and attitude.  (1, 10)"""
        return np.array(self._plant.state.x)[None, POSE]

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for a copy, which must be reset before it is used.

        The simulated world of the present episode cannot be copied.
        """
        return self.__dict__ | {"_plant": None}

    def _close_plant(self) -> None:
        if self._plant is not None:
            self._plant.close()
            self._plant = None


class _NoController:
    """A placeholder for the controller of a flight whose controls come from `step`."""

    def control(self, x: np.ndarray) -> np.ndarray:
        """Raise an error, because controls come from `step`."""
        raise NotImplementedError
