"""A race of several vehicles as a ParallelEnv of PettingZoo (extra rl)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from quadsim.files.extras import needs_extra

try:
    from gymnasium.error import ResetNeeded
    from gymnasium.spaces import Box
    from pettingzoo import ParallelEnv
except ImportError:
    raise ImportError(f"RacingParallelEnv: {needs_extra('pettingzoo', 'rl')}") from None

from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value
from quadsim.learn.races import Races
from quadsim.learn.render import RENDER_MODES, Renderer, ViewerFactory
from quadsim.learn.spaces import (
    ACTIONS,
    FAR,
    action_space,
    checked_actions,
    checked_reset,
)


class RacingParallelEnv(ParallelEnv[str, np.ndarray, np.ndarray]):
    """A race of 2 to 8 vehicles with the agents racer_0, racer_1 and so on.

    All start together. A racer leaves `agents` after the step in which it finishes, crashes or
    collides with another racer; both are then out. At the time limit all racers leave.

    Args:
        course: a name, a FILE.yaml or a Course.
        threads: CPU threads of this process; None does not change them.
        render_mode: None or "rgb_array".
        viewer: function that makes a viewer for every step, see RacingVectorEnv.
        settings: racers, collision_distance, vehicle, laps, reward, dt, start, randomize,
            time_limit and noise; see quadsim.learn.race_task.race_task.

    Raises:
        SettingError, FileError: a value is invalid (both are ValueError).

    Examples:
        >>> from quadsim.learn import RacingParallelEnv
        >>> env = RacingParallelEnv("figure8", racers=2)
        >>> observations, infos = env.reset(seed=0)
        >>> actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        >>> observations, rewards, ended, cut, infos = env.step(actions)
        >>> sorted(info["rank"] for info in infos.values())
        [1, 2]
    """

    metadata = {  # noqa: RUF012 (PettingZoo declares it so)
        "name": "quadsim_racing_v0",
        "render_modes": list(RENDER_MODES),
        "render_fps": 100,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        course: Any = "split_s_swift",
        *,
        threads: int | None = None,
        render_mode: str | None = None,
        viewer: ViewerFactory | None = None,
        **settings: Any,
    ):
        self._races = Races(1, restart=False, threads=threads, course=course, **settings)
        self.task = self._races.task
        if len(self.task.courses) != 1:
            raise SettingError("course", f"expected one, got {len(self.task.courses)}")
        dt = self.task.dt
        racers = self.task.racers
        self.render_mode = render_mode
        self._renderer = Renderer(render_mode, viewer, self.task.courses[0], racers, dt)
        self.metadata = self.metadata | {"render_fps": round(1 / dt)}
        self.possible_agents = [f"racer_{number}" for number in range(racers)]
        self.agents: list[str] = []
        size = self._races.size
        self._observation_spaces = {
            agent: Box(-FAR, FAR, (size,), np.float32) for agent in self.possible_agents
        }
        self._action_spaces = {agent: action_space() for agent in self.possible_agents}
        self._number = {agent: number for number, agent in enumerate(self.possible_agents)}

    def observation_space(self, agent: str) -> Box:
        """Return the space of a racer's observations.  (38 + 7 * number of opponents,)"""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """Return the space of a racer's actions, body rates about x, y, z and thrust.  (4,)"""
        return self._action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Start a race and return the observations and an empty info of each racer.

        Args:
            seed: seed of a new series of races, 0 to 2^63 - 1; None: the series continues.
            options: not used; wrappers may pass any.

        Raises:
            SettingError: the seed is not an integer, or out of range.
        """
        seed = checked_reset(seed, options)
        (obs,) = self._races.reset(seed)
        self.agents = list(self.possible_agents)
        self._renderer.update(self._state_rows)
        observations = dict(zip(self.agents, obs, strict=True))
        return observations, {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, np.ndarray]
    ) -> tuple[
        dict[str, np.ndarray],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Fly one step of dt.

        Args:
            actions: an action (4,) for each of `agents`, clipped to -1..1.

        Returns:
            Observations, rewards, terminations, truncations and infos of the racers that took part
            in this step. An info has `passed`, whether a gate was passed, `gates` passed since the
            start, `lap` (from 1), `time` [s], `crashed`, `collided` with another racer, `finished`
            and `rank` (from 1).

        Raises:
            ValueError: an action is missing, belongs to a racer that is out, has a wrong shape, or
                is not finite.
            gymnasium.error.ResetNeeded: before the first reset, or when the race is over.
        """
        if not self.agents:
            raise ResetNeeded("RacingParallelEnv: no racer flies: reset() starts a race")
        given = self._checked(actions)
        obs, reward, ended, cut, info = self._races.step(given[None])
        self._renderer.update(self._state_rows)
        flew = self.agents
        at = [self._number[agent] for agent in flew]
        told = [name for name in info if name not in ("over", "racing")]
        rewards = {agent: float(reward[0, k]) for agent, k in zip(flew, at, strict=True)}
        terminations = {agent: bool(ended[0, k]) for agent, k in zip(flew, at, strict=True)}
        truncations = {agent: bool(cut[0, k]) for agent, k in zip(flew, at, strict=True)}
        infos = {
            agent: {name: info[name][0, k].item() for name in told}
            for agent, k in zip(flew, at, strict=True)
        }
        observations = {agent: obs[0, k] for agent, k in zip(flew, at, strict=True)}
        self.agents = [agent for agent in flew if not (terminations[agent] or truncations[agent])]
        return observations, rewards, terminations, truncations, infos

    def render(self) -> np.ndarray | None:
        """Return a picture from above if the mode is rgb_array.  (height, width, 3) uint8"""
        return self._renderer.picture(self._state_rows())

    def close(self) -> None:
        """Close the viewer."""
        self._renderer.close()

    def _checked(self, actions: Any) -> np.ndarray:
        """Return the actions of all racers, zeros for racers that are out.  (racers, 4)"""
        if not isinstance(actions, Mapping):
            wanted = f"expected a dict with an action for each of {', '.join(self.agents)}"
            raise ValueError(f"actions: {wanted}, got {shown_value(actions)}")
        for agent in actions:
            if agent not in self.agents:
                flying = ", ".join(self.agents)
                raise ValueError(f"actions: expected {flying}, which fly, got {shown_value(agent)}")
        found = np.zeros((len(self.possible_agents), ACTIONS), np.float32)
        for agent in self.agents:
            if agent not in actions:
                raise ValueError(f"actions: expected one for {agent}, which flies, got none")
            try:
                found[self._number[agent]] = checked_actions(actions[agent], (ACTIONS,))
            except ValueError as error:
                raise ValueError(f"{agent}: {error}") from None
        return found

    def _state_rows(self) -> np.ndarray:
        """Return position, velocity and attitude of each racer.  (racers, 10)"""
        return self._races.state_rows()[0]
