"""Checkpoints of a training: the parameters of policy and value function, and the history.

A training that continues from a checkpoint draws new episodes and new exploration. The file has
only numbers and JSON, and no code.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypedDict

import numpy as np
from msgspec import Meta, Struct

from quadsim.files.arrays import (
    TEXT,
    Declared,
    expect_format,
    listed,
    npz_bytes,
    read_arrays,
    record_of,
)
from quadsim.files.strict_yaml import FileError

FORMAT = "quadsim training 5"
WHAT = "a checkpoint of `race train` for this task"
# Greatest absolute value of a parameter; the networks have numbers of the order of one
LARGEST_PARAMETER = 1e6

Share = Annotated[float, Meta(ge=0, le=1)]
Steps = Annotated[int, Meta(ge=1, le=10**15)]


class Evaluation(TypedDict):
    """A row of a training's history."""

    steps: Steps  # of the environments so far
    reward: Annotated[float, Meta(ge=-1e9, le=1e9)]  # per second flown [1/s]
    flights: Annotated[int, Meta(ge=1, le=10**6)]  # races of the evaluation
    finished: Share  # of the races
    lap: Annotated[float, Meta(ge=0, le=1e6)]  # mean of the finished races [s]; 0 without one
    gates: Share  # that were passed
    seconds: Annotated[float, Meta(ge=0, le=1e12)]  # of training so far [s]


class Checkpoint(NamedTuple):
    """The state of a training after an evaluation."""

    parameters: dict[str, np.ndarray]  # of policy and value function
    steps_done: int
    history: list[Evaluation]


class StoredCheckpoint(Struct, forbid_unknown_fields=True):
    """The JSON document in a checkpoint's file."""

    format: str
    identity: dict[str, Any]
    steps_done: Steps
    history: Annotated[list[Evaluation], Meta(min_length=1)]


def checkpoint_bytes(checkpoint: Checkpoint, identity: Mapping[str, Any]) -> bytes:
    """Return the content of a checkpoint's file.

    Args:
        checkpoint: state of the training.
        identity: settings of the training; only a training with equal settings may continue it.
    """
    state = {
        "format": FORMAT,
        "identity": dict(identity),
        "steps_done": checkpoint.steps_done,
        "history": checkpoint.history,
    }
    text = json.dumps(state, allow_nan=False)
    return npz_bytes({"state": np.array(text)} | checkpoint.parameters)


def read_checkpoint(
    path: Path, parameters: Mapping[str, np.ndarray], identity: Mapping[str, Any]
) -> Checkpoint:
    """Return the checkpoint in a file.

    Args:
        path: the file.
        parameters: arrays with the expected names, types and shapes.
        identity: settings of the present training.

    Raises:
        FileError: the file is damaged, or belongs to a different training.
    """
    declared = {
        name: Declared(str(array.dtype), array.shape, most=LARGEST_PARAMETER)
        for name, array in parameters.items()
    }
    arrays = read_arrays(path, declared | {"state": TEXT}, WHAT)
    text = arrays.pop("state")
    advice = "it was written by another version: take another --out, or remove the file"
    expect_format(text, FORMAT, path, WHAT, advice)
    state = record_of(text, StoredCheckpoint, path, WHAT)

    # The round trip through JSON turns tuples into lists, as in the stored identity.
    asked = json.loads(json.dumps(dict(identity)))
    names = listed(sorted(differences(asked, state.identity)))
    if names:
        advice = "take another --out, or remove the file to begin anew"
        raise FileError(f"{path}: expected a training of the same {names}: {advice}")
    steps = [row["steps"] for row in state.history]
    rises = all(before < after for before, after in pairwise(steps))
    if not rises or steps[-1] != state.steps_done:
        wanted = f"expected rising steps up to steps_done = {state.steps_done} in its history"
        raise FileError(f"{path}: expected {WHAT}: {wanted}, got others")
    return Checkpoint(arrays, state.steps_done, state.history)


def differences(asked: Any, stored: Any, name: str = "") -> Iterator[str]:
    """Yield the names of the values that differ, such as "vehicle.mass".

    Args:
        asked: present values, as JSON.
        stored: values of a file, as JSON.
        name: name of the compared value, "" at the top level.
    """
    if isinstance(asked, dict) and isinstance(stored, dict):
        for key in asked | stored:
            inner = f"{name}.{key}" if name else key
            yield from differences(asked.get(key), stored.get(key), inner)
    elif asked != stored:
        yield name
