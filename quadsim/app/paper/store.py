"""Finished runs: one JSON line each in an append-only file, so that none is ever made twice."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

from quadsim.record.run import RunError, canonical


def run_key(settings: dict) -> str:
    """Of everything that decides a run: 16 hex digits of the sha256 of its JSON."""
    return sha256(canonical(settings)).hexdigest()[:16]


class Store:
    """Key -> record. What a kill left half-written is dropped. Raises RunError where the file cannot be used."""

    def __init__(self, path: Path):
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self.records = dict(_whole_lines(path))
        except OSError as error:
            raise RunError(f"{path}: cannot keep runs here: {error.strerror or error}") from error

    def add(self, key: str, record: dict) -> None:
        """On the disk when this returns."""
        line = canonical({"key": key, "record": record}) + b"\n"
        try:
            with self.path.open("ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise RunError(f"{self.path}: cannot write: {error.strerror or error}") from error
        self.records[key] = record


def _whole_lines(path: Path) -> Iterator[tuple[str, dict]]:
    if not path.exists():
        return
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    if whole < len(data):
        os.truncate(path, whole)
    for line in data[:whole].splitlines():
        entry = json.loads(line)
        yield entry["key"], entry["record"]
