"""Compiled code on the disk, one file for each function and signature: the sha256 of the code, then
the code.

It stands in for numba's cache, which loads what it finds: there a file that was cut short or
changed ends every later flight in a traceback or in an illegal instruction.
"""

from __future__ import annotations

import linecache
import logging
import os
import pickle
import sys
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from quadsim.files.atomic import replace_file

SUM = sha256().digest_size
LARGEST = 50_000_000  # [bytes] that are read, of a device too; the code of a planner has 300 000
log = logging.getLogger("quadsim")  # of a program that has not set up logging: one line on stderr


def cache_folder() -> Path | None:
    """$XDG_CACHE_HOME/quadsim or ~/.cache/quadsim, which may not exist yet; None where the user has
    no home."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    # a relative one is to be ignored, by the specification of these folders
    if not os.path.isabs(home):
        home = os.path.expanduser("~/.cache")
    return Path(home) / "quadsim" if os.path.isabs(home) else None


class CodeCache(NullCache):
    """The code of one function, by the members of numba's caches."""

    complained = False  # that code cannot be kept: once for a process

    def __init__(self, function: Any):
        self._stem = self.stem(function.py_func)
        text = "".join(linecache.getlines(function.py_func.__code__.co_filename))
        options = {
            k: sorted(v) if isinstance(v, set) else v
            for k, v in sorted(function.targetoptions.items())
        }
        self._made_of = f"{numba.__version__} {sys.version_info[:2]} {options} {text}"

    @staticmethod
    def stem(function: Any) -> str:
        return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The code for this signature and this processor, None where there is none that is
        whole."""
        target_context.refresh()
        path = self._path(sig, target_context.codegen())
        code = _read(path) if path else None
        return None if code is None else CompileResult._rebuild(target_context, *pickle.loads(code))

    def save_overload(self, sig: Any, data: Any) -> None:
        path = self._path(sig, data.codegen)
        # numba cannot keep these
        if data.lifted or data.library.has_dynamic_globals or CodeCache.complained:
            return
        try:
            if path is None:
                raise OSError(0, "no home folder, and XDG_CACHE_HOME is not set")
            _keep(path, dumps(data._reduce()))
        except OSError as error:
            CodeCache.complained = True
            where = path.parent if path else "compiled code"
            log.warning(
                f"{where}: cannot keep compiled code: {error.strerror}; each start compiles anew, some 20 s"
            )

    def _path(self, sig: Any, codegen: Any) -> Path | None:
        """Named after all that decides what the code is."""
        folder = cache_folder()
        decides = sha256(f"{self._made_of} {sig} {codegen.magic_tuple()}".encode()).hexdigest()[:16]
        return folder / f"{self._stem}-{decides}.code" if folder else None


def _read(path: Path) -> bytes | None:
    """Code as it was written; None where there is none, and with one line where it cannot be
    used."""
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST)
    except FileNotFoundError:
        return None
    except OSError as error:
        log.warning(f"{path}: cannot read compiled code: {error.strerror}; compiled anew")
        return None
    code = data[SUM:]
    if sha256(code).digest() != data[:SUM]:
        log.warning(f"{path}: damaged compiled code, compiled anew")
        return None
    return code


def _keep(path: Path, code: bytes) -> None:
    """Raises OSError, and then leaves no new folder."""
    made = [folder for folder in (path.parent, *path.parent.parents) if not folder.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        replace_file(path, sha256(code).digest() + code)
    except OSError:
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()
        raise
