"""Checkpoints of a training: the parameters of policy and value function, and its history.

A training that continues from a checkpoint draws new episodes and new exploration. The file holds
numbers and JSON alone; nothing in it is executed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from quadsim.files.arrays import TEXT, Declared, npz_bytes, read_arrays, record_of
from quadsim.files.strict_yaml import FileError

FORMAT = "quadsim training 3"
WHAT = "a checkpoint of `race train` for this task"


class Checkpoint(NamedTuple):
    """A training up to an evaluation."""

    parameters: dict[str, np.ndarray]  # of policy and value function
    steps_done: int
    history: list[dict]


def checkpoint_bytes(checkpoint: Checkpoint, identity: Mapping[str, Any]) -> bytes:
    """Return the content of a checkpoint's file.

    Args:
        checkpoint: the training up to now.
        identity: settings of the training, which continues only where they are the same.
    """
    state = {
        "format": FORMAT,
        "identity": dict(identity),
        "steps_done": checkpoint.steps_done,
        "history": checkpoint.history,
    }
    return npz_bytes({"state": np.array(json.dumps(state))} | checkpoint.parameters)


def read_checkpoint(
    path: Path, parameters: Mapping[str, np.ndarray], identity: Mapping[str, Any]
) -> Checkpoint:
    """Return the checkpoint in a file.

    Args:
        path: the file.
        parameters: arrays whose names, types and shapes the file has to have.
        identity: settings that are asked for now.

    Raises:
        FileError: the file is damaged, or it is of another training.
    """
    declared = {
        name: Declared(str(array.dtype), array.shape, finite=True)
        for name, array in parameters.items()
    }
    arrays = read_arrays(path, declared | {"state": TEXT}, WHAT)
    state = record_of(arrays.pop("state"), path, WHAT)
    if state.get("format") != FORMAT:
        raise FileError(f"{path}: expected format {FORMAT!r}: it was written by another version")
    # The round trip through JSON turns tuples into lists, as in the stored identity.
    asked = json.loads(json.dumps(dict(identity)))
    stored = state["identity"]
    if stored != asked:
        names = sorted(k for k in asked | stored if asked.get(k) != stored.get(k))
        wanted = f"expected a training of the same {', '.join(names)}"
        advice = "take another --out, or remove the file to begin anew"
        raise FileError(f"{path}: {wanted}: {advice}")
    return Checkpoint(arrays, state["steps_done"], state["history"])
