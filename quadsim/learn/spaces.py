"""Spaces of the environments, and the checks of an action, a seed and the options of a reset."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Annotated, Any

import numpy as np
from gymnasium.spaces import Box
from msgspec import Meta, inspect

from quadsim.controllers.learned.observation import SIZE
from quadsim.files.values import SettingError, checked_object
from quadsim.files.yaml_errors import shown_value

ACTIONS = 4
# Bound of every observed number in its unit, far beyond any flight within a course's bounds; the
# checks of Gymnasium and of stable-baselines3 warn of infinite bounds.
FAR = 1e6
SEED = inspect.type_info(Annotated[int, Meta(ge=0, le=2**63 - 1)])


def observation_space() -> Box:
    """Return the space of observations  (SIZE,); see `UNITS` of the observation."""
    return Box(-FAR, FAR, (SIZE,), np.float32)


def action_space() -> Box:
    """Return the space of actions, body rates about x, y, z and thrust.  (4,)

    The values -1 and 1 stand for the vehicle's limits.
    """
    return Box(-1.0, 1.0, (ACTIONS,), np.float32)


def checked_actions(actions: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return actions as a float32 array with a given shape.

    Raises:
        ValueError: the actions are not numbers, have another shape, or are not finite.
    """
    wanted = f"expected numbers in -1..1 of shape {shape}"
    try:
        given = np.asarray(actions)
    except (TypeError, ValueError):  # lists of different lengths
        raise ValueError(f"action: {wanted}, got {type(actions).__name__}") from None
    if given.dtype.kind not in "fiub":
        got = f"{type(actions).__name__} of {given.dtype}"
        raise ValueError(f"action: {wanted}, got {got}")
    with np.errstate(over="ignore"):
        found = given.astype(np.float32, copy=False)
    if found.shape != shape:
        raise ValueError(f"action: expected shape {shape}, got {found.shape}")
    if not np.isfinite(found).all():
        first = np.argwhere(~np.isfinite(found))[0].tolist()
        number = found[tuple(first)]
        raise ValueError(f"action{first}: expected a finite number in -1..1, got {number}")
    return found


def checked_reset(seed: Any, options: Any, known: Collection[str] | None = None) -> int | None:
    """Return the seed of a reset as an int, None if none is given.

    Args:
        seed: the seed.
        options: the options.
        known: names of the options; None: no option is used and any may be given, because libraries
            pass on options that are meant for other environments.

    Raises:
        SettingError: the seed is not an integer or out of range, or the options are not a dict
            or have an unknown name.
    """
    if not (options is None or isinstance(options, Mapping)):
        raise SettingError("options", f"expected a dict or None, got {shown_value(options)}")
    unknown = [name for name in options or () if known is not None and name not in known]
    if unknown:
        wanted = f"expected {' or '.join(map(repr, known or ()))}"
        raise SettingError("options", f"{wanted}, got {shown_value(unknown[0])}")
    return None if seed is None else checked_object("seed", seed, SEED)
