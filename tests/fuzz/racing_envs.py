"""Learning environments with wrong settings, seeds, options and actions, again and again."""

from __future__ import annotations

import copy
import pickle
import random
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded

from quadsim.learn.bullet_env import RacingBulletEnv
from quadsim.learn.single_env import RacingEnv
from quadsim.learn.vector_env import RacingVectorEnv
from tests.fuzz.harness import Case
from tests.fuzz.junk import junk, reported

KINDS = (RacingEnv, RacingVectorEnv, RacingBulletEnv)
SETTINGS = ("laps", "start", "noise", "time_limit", "dt", "randomize", "vehicle", "course")
SETTINGS = (*SETTINGS, "reward", "render_mode", "viewer", "bogus")
OF_MANY = ("num_envs", "threads", "autoreset_mode")
TERMS = ("crash", "progress", "margin", "time", "bogus")


def racing_envs(rng: random.Random) -> Case:
    """Return a case with one wrong setting, or with a life of wrong calls."""
    kind = rng.choice(KINDS)
    action: Callable[[], object]
    if rng.random() < 0.5:
        known = (*SETTINGS, *OF_MANY) if kind is RacingVectorEnv else SETTINGS
        name = rng.choice(known)
        value = junk(rng)
        if name == "reward" and rng.random() < 0.8:
            value = {rng.choice(TERMS): value}
        action = partial(make, kind, **{name: value})
        label = f"{kind.__name__}({name}={value!r:.60})"
    else:
        seed = rng.random()
        action = partial(live, kind, random.Random(seed))
        label = f"{kind.__name__}: calls of the seed {seed}"
    call = partial(reported, action)
    return Case("racing_envs", label, (), call=call, codes=frozenset({0, 2}))


def make(kind: Any, **settings: Any) -> Any:
    """Return an environment, after a step."""
    plant = {"plant": "rigid"} if kind.__name__ == "RacingBulletEnv" else {}
    env = kind(**{"course": "figure8"} | plant | settings)
    env.reset(seed=1)
    env.step(np.zeros(env.action_space.shape, np.float32))
    return env


def live(kind: Any, rng: random.Random) -> None:
    """Misuse an environment; then it has to fly as a new one does."""
    env = make(kind)
    for _ in range(rng.randint(1, 12)):
        match rng.randrange(5):
            case 0:
                call = partial(env.reset, seed=junk(rng))
            case 1:
                call = partial(
                    env.reset, options=rng.choice((junk(rng), {"reset_mask": junk(rng)}))
                )
            case 2 | 3:
                call = partial(env.step, junk(rng))
            case _:
                env = rng.choice((copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))))(env)
                continue
        try:
            call()
        except ResetNeeded:
            env.reset()
        except ValueError as error:
            if len(str(error).splitlines()) != 1:
                raise
    assert _flown(env) == _flown(make(kind)), "misuse has changed the environment"


def _flown(env: Any) -> bytes:
    observations, _ = env.reset(seed=1)
    seen = [observations]
    for _ in range(3):
        seen.append(env.step(np.zeros(env.action_space.shape, np.float32))[0])
    return np.array(seen).tobytes()
