"""What a training needs to go on after a kill: weights, optimisers, random state, history; numbers
and JSON alone."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import error as zlib_error

import numpy as np

from quadsim.files.strict_yaml import FileError
from quadsim.learn.ppo import PPO

FORMAT = "quadsim training 2"


def checkpoint_bytes(ppo: PPO, identity: Mapping[str, Any], history: list[dict]) -> bytes:
    """identity: what was asked for; a training goes on only where it is the same."""
    state = {
        "format": FORMAT,
        "identity": dict(identity),
        "updates": ppo.updates,
        "rate": ppo.rate,
        "reward": ppo.reward,
        "steps": [ppo.adam.steps, ppo.value_adam.steps],
        "random": ppo.rng.bit_generator.state,
        "history": history,
    }
    buffer = BytesIO()
    arrays = {f"array_{k}": a for k, a in enumerate(_arrays(ppo))}
    np.savez(buffer, allow_pickle=False, state=np.array(json.dumps(state)), **arrays)
    return buffer.getvalue()


def restore(ppo: PPO, path: Path, identity: Mapping[str, Any]) -> list[dict]:
    """Fill ppo from the file; its history. Raises FileError where it is of another training or
    damaged."""
    try:
        with np.load(path, allow_pickle=False) as found:
            state = json.loads(str(found["state"][()]))
            arrays = [found[f"array_{k}"] for k in range(len(_arrays(ppo)))]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib_error) as error:
        raise FileError(
            f"{path}: expected a checkpoint of `race train`, cannot be read: {error}"
        ) from None
    if state.get("format") != FORMAT:
        raise FileError(f"{path}: expected format {FORMAT!r}: it was written by another version")
    asked = json.loads(json.dumps(dict(identity)))
    if state["identity"] != asked:
        differs = sorted(
            k for k in asked | state["identity"] if asked.get(k) != state["identity"].get(k)
        )
        wanted = f"expected a training of the same {', '.join(differs)}"
        raise FileError(f"{path}: {wanted}: take another --out, or remove the file to begin anew")
    for own, stored in zip(_arrays(ppo), arrays, strict=True):
        if own.shape != stored.shape or not np.isfinite(stored).all():
            raise FileError(
                f"{path}: expected finite numbers of shape {own.shape}, got {stored.shape}"
            )
        own[:] = stored
    ppo.updates, ppo.rate, ppo.reward = state["updates"], state["rate"], state["reward"]
    ppo.adam.steps, ppo.value_adam.steps = state["steps"]
    ppo.rng.bit_generator.state = state["random"]
    return state["history"]


def _arrays(ppo: PPO) -> list[np.ndarray]:
    adams = [a for adam in (ppo.adam, ppo.value_adam) for a in (*adam.first, *adam.second)]
    return [*ppo.policy, *ppo.value, *adams]
