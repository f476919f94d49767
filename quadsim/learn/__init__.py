"""Gymnasium environments on the compiled lanes: `quadsim/Racing-v0` and `quadsim/RacingBullet-v0`.

    import gymnasium
    import quadsim.learn

    envs = gymnasium.make_vec("quadsim/Racing-v0", num_envs=4096, course="split_s_swift")

Importing this package registers the environments. A name with the package in front imports it:
`gymnasium.make("quadsim.learn:quadsim/Racing-v0")`.

A race of several vehicles is a ParallelEnv of PettingZoo, `quadsim.learn.RacingParallelEnv`; many
races in arrays are `quadsim.learn.races.Races`.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quadsim.learn.parallel_env import RacingParallelEnv as RacingParallelEnv

RACING = "quadsim/Racing-v0"
BULLET = "quadsim/RacingBullet-v0"


def register_environments() -> None:
    """Register the environments with Gymnasium, unless they are already registered.

    Raises:
        ImportError: Gymnasium is not installed.
    """
    from gymnasium.envs import registration

    if RACING in registration.registry:
        return
    registration.register(
        RACING,
        entry_point="quadsim.learn.single_env:RacingEnv",
        vector_entry_point="quadsim.learn.vector_env:RacingVectorEnv",
    )
    registration.register(BULLET, entry_point="quadsim.learn.bullet_env:RacingBulletEnv")


# the compiled lanes work without Gymnasium
with suppress(ImportError):
    register_environments()


def __getattr__(name: str) -> Any:
    """Import RacingParallelEnv on demand, as it needs PettingZoo."""
    if name == "RacingParallelEnv":
        from quadsim.learn.parallel_env import RacingParallelEnv

        return RacingParallelEnv
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
