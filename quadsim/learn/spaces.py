"""Spaces of the environments, and the check of an action."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box

from controllers.learned.observation import SIZE

ACTIONS = 4


def observation_space() -> Box:
    """Return the space of observations; see controllers.learned.observation.UNITS.  (SIZE,)"""
    return Box(-np.inf, np.inf, (SIZE,), np.float32)


def action_space() -> Box:
    """Return the space of actions, body rates about x, y, z and thrust.  (4,)

    -1 and 1 are the vehicle's limits.
    """
    return Box(-1.0, 1.0, (ACTIONS,), np.float32)


def checked_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return actions as float32 of this shape.

    Raises:
        ValueError: the actions are not numbers, have another shape, or are not finite.
    """
    try:
        found = np.asarray(actions, np.float32)
    except (TypeError, ValueError):
        wanted = f"expected numbers in -1..1 of shape {shape}"
        raise ValueError(f"action: {wanted}, got {type(actions).__name__}") from None
    if found.shape != shape:
        raise ValueError(f"action: expected shape {shape}, got {found.shape}")
    if not np.isfinite(found).all():
        first = np.argwhere(~np.isfinite(found))[0].tolist()
        number = found[tuple(first)]
        raise ValueError(f"action{first}: expected a finite number in -1..1, got {number}")
    return found
