"""Gymnasium environments on the compiled lanes: `quadsim/Racing-v0` and `quadsim/RacingBullet-v0`.

    import gymnasium
    import quadsim.learn

    envs = gymnasium.make_vec("quadsim/Racing-v0", num_envs=4096, course="split_s_swift",
    vehicle="swift")

Importing this package registers them; an installed quadsim is found by Gymnasium without the
import.
"""

from __future__ import annotations

from contextlib import suppress

RACING, BULLET = "quadsim/Racing-v0", "quadsim/RacingBullet-v0"


def register_environments() -> None:
    """Tell Gymnasium of the environments, once. Raises ImportError where it is not installed."""
    from gymnasium.envs import registration

    if RACING in registration.registry:
        return
    home = "quadsim.learn"
    registration.register(
        RACING,
        entry_point=f"{home}.single_env:RacingEnv",
        vector_entry_point=f"{home}.vector_env:RacingVectorEnv",
    )
    registration.register(BULLET, entry_point=f"{home}.bullet_env:RacingBulletEnv")


with suppress(ImportError):  # the lanes need no Gymnasium
    register_environments()
