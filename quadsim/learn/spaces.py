"""What all environments share: spaces, and what they say of a wrong action."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box

from controllers.learned.observation import SIZE

ACTIONS = 4


def observation_space() -> Box:
    """See controllers.learned.observation.UNITS."""
    return Box(-np.inf, np.inf, (SIZE,), np.float32)


def action_space() -> Box:
    """Body rates about x, y, z and thrust; -1 and 1 are the vehicle's limits."""
    return Box(-1.0, 1.0, (ACTIONS,), np.float32)


def checked_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """float32 of this shape. Raises ValueError that says what came."""
    try:
        found = np.asarray(actions, np.float32)
    except (TypeError, ValueError):
        raise ValueError(
            f"action: expected numbers in -1..1 of shape {shape}, got {type(actions).__name__}"
        ) from None
    if found.shape != shape:
        raise ValueError(f"action: expected shape {shape}, got {found.shape}")
    if not np.isfinite(found).all():
        where = np.argwhere(~np.isfinite(found))[0].tolist()
        raise ValueError(
            f"action{where}: expected a finite number in -1..1, got {found[tuple(where)]}"
        )
    return found
