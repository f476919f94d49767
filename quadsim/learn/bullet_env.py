"""`quadsim/RacingBullet-v0`: the same task in PyBullet, with rotors, allocation and the referee,
for evaluation."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.error import ResetNeeded

from controllers.costs.race import progress
from controllers.learned.observation import command, gate_rows, normalised, observe
from quadsim.dynamics.quadrotor import POSE, Control
from quadsim.learn.render import RENDER_MODES, Renderer
from quadsim.learn.reward import reward as reward_of
from quadsim.learn.spaces import ACTIONS, action_space, checked_actions, observation_space
from quadsim.learn.task import task
from quadsim.race.flight import apply_control, whole_multiple
from quadsim.spec.build import build
from quadsim.spec.settings import SettingError
from quadsim.spec.spec import Spec


class RacingBulletEnv(Env):
    """One race as `race fly` simulates it. Rewards as in Racing-v0, but those of the margin, which
    it does not measure.

    Args:
        course, vehicle, laps, reward, dt, randomize, time_limit: see quadsim.learn.task.task; one
            course.
        plant: "bullet" or "rigid"; None: bullet where PyBullet is installed.

    Raises:
        SettingError, FileError: a value that does not fit (both are ValueError).
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 100}  # noqa: RUF012

    def __init__(self, render_mode: str | None = None, plant: str | None = None, **of_task: Any):
        self.task, self.render_mode = task(**of_task), render_mode
        t = self.task
        if len(t.courses) != 1:
            raise SettingError("course", f"expected one, got {len(t.courses)}")
        if t.start != "standing":
            raise SettingError(
                "start", f"expected standing, got {t.start!r}: elsewhere Racing-v0 starts"
            )
        self._renderer = Renderer(render_mode, t.courses[0], 1, t.dt)
        asked = {
            "laps": t.laps[0],
            "randomize": t.randomize,
            "timeout": t.time_limit,
            "dt": t.dt,
            "plant": plant,
        }
        given = {name: value for name, value in asked.items() if value is not None}
        self._spec = replace(
            Spec.of(t.courses[0], controller=_Nobody(), **given), vehicle=t.vehicle
        )
        self._system = t.system
        self._cost, self._gates = t.cost(0), gate_rows(t.courses[0], t.laps[0])
        self._plant: Any = None
        self.observation_space, self.action_space = observation_space(), action_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode; the seed decides what is randomized."""
        super().reset(seed=seed)
        self._close_plant()
        number = int(self.np_random.integers(10**9)) if seed is None else seed
        self._plant, _, self._referee = build(replace(self._spec, seed=number))
        self._last = normalised(self._system.rest, self._system.low, self._system.high)
        self._way = self._way_left()
        self._renderer.update(self._state_rows)
        return self._observed(), {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One step of dt under an action (4,); see RacingVectorEnv.step. `crashed` is the referee's
        word."""
        chosen = np.clip(checked_actions(action, (ACTIONS,)), -1, 1).astype(float)
        if self._plant is None or self._referee.outcome is not None:
            raise ResetNeeded("RacingBullet-v0: step() before reset()")
        u = command(chosen, self._system.low, self._system.high)
        before, way = self._referee.passed, self._way
        until = self._plant.state.t + whole_multiple(self.task.dt, self._plant.dt) * self._plant.dt
        events = apply_control(self._plant, self._referee, tuple(u.tolist()), until)
        outcome = self._referee.outcome
        passed, crashed = self._referee.passed - before, outcome in ("crashed", "stuck")
        self._way = self._way_left()
        weights, shortened = self.task.rewards.params, way - self._way
        action, last = Control(*chosen), Control(*self._last)
        paid = reward_of(shortened, 0.0, float(crashed), float(passed), action, last, weights)
        self._last = chosen
        self._renderer.update(self._state_rows)
        info = {
            "passed": bool(passed),
            "gates": self._referee.passed,
            "lap": self._referee.lap,
            "time": self._plant.state.t,
            "crashed": crashed,
            "finished": outcome == "finished",
            "events": [event.kind for event in events],
        }
        return (
            self._observed(),
            float(paid),
            crashed or outcome == "finished",
            outcome == "timeout",
            info,
        )

    def _observed(self) -> np.ndarray:
        return observe(self._plant.state.x, self._gates[self._referee.passed], self._last)

    def _way_left(self) -> float:
        """To the finish, as the racing cost measures it [m]."""
        x = self._plant.state.x
        row = self._cost.targets[min(self._referee.passed, len(self._cost.targets) - 1)]
        return float(progress(x, x, self._system.rest, self._cost.row(*row), self._cost.params))

    def _state_rows(self) -> np.ndarray:
        """Position, velocity and attitude.  (1, 10)"""
        return np.array(self._plant.state.x)[None, POSE]

    def render(self) -> Any:
        """With rgb_array a picture from above.  (height, width, 3) uint8"""
        return self._renderer.picture(self._state_rows())

    def close(self) -> None:
        self._renderer.close()
        self._close_plant()

    def _close_plant(self) -> None:
        if self._plant is not None:
            self._plant.close()
            self._plant = None


class _Nobody:
    """In the controller's place of a flight whose controls come from outside."""

    def control(self, x: np.ndarray) -> np.ndarray:
        raise NotImplementedError
