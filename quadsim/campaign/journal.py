"""The journal of a search: a file of JSON lines that optuna writes and reads back. Needs the extra
`tune`.

optuna's own file backend fails for ever on the half line that a full disk or a kill leaves, and its
lock outlives its process for half a minute.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from optuna.storages.journal import BaseJournalBackend

from quadsim.console import complain
from quadsim.record.run import RunError
from quadsim.record.whole_files import expect_file, one_line


class Journal(BaseJournalBackend):
    """Lines end in a newline; what follows the last one is half a line, which the next writer
    removes."""

    def __init__(self, path: Path):
        """Raises RunError."""
        expect_file(path)
        self.path = path
        self.line = 0  # the last that was handed out, from 1
        self._lines: list[bytes] = []
        self._end = 0  # of the last of them [bytes]
        with one_line(path, "cannot keep the search here"):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.open("ab").close()

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        """Records from this number on. Raises RunError."""
        with one_line(self.path, "cannot read"), self.path.open("rb") as file:
            file.seek(self._end)
            new = file.read()
        whole = new[: new.rfind(b"\n") + 1]
        self._lines += whole.splitlines(keepends=True)
        self._end += len(whole)
        for number in range(log_number_from, len(self._lines)):
            self.line = number + 1
            yield self._record(self._lines[number])

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """All of them or none. Raises RunError."""
        data = "".join(json.dumps(log, separators=(",", ":")) + "\n" for log in logs).encode()
        with one_line(self.path, "cannot keep the search here"), self._locked() as file:
            end = self._without_half_a_line(file)
            try:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            except BaseException:
                os.ftruncate(file.fileno(), end)
                raise

    def damaged(self, why: object) -> RunError:
        """At the line that was read last."""
        advice = "cut the file before this line, or move it away to search anew"
        return RunError(f"{self.path}:{self.line}: damaged: {why}; {advice}")

    def _record(self, line: bytes) -> dict[str, Any]:
        try:
            record = json.loads(line)
        except ValueError as error:
            raise self.damaged(error) from None
        if not isinstance(record, dict):
            raise self.damaged(f"expected a JSON object, got {line[:40]!r}")
        return record

    @contextmanager
    def _locked(self) -> Iterator[BinaryIO]:
        """The file, for one process at a time; the lock ends with its process."""
        with self.path.open("ab", buffering=0) as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield file

    def _without_half_a_line(self, file: BinaryIO) -> int:
        """Cut what follows the last newline, and say so; where the file ends then [bytes]."""
        data = self.path.read_bytes()
        end = data.rfind(b"\n") + 1
        if end < len(data):
            os.ftruncate(file.fileno(), end)
            complain(
                f"{self.path}: the last line was not written to its end and is removed: {len(data) - end} bytes"
            )
        return end
