"""The cache of compiled code on the disk, with a file for each function and signature.

A file has the sha256 of the code, then the code. This cache replaces numba's, which loads files
unchecked: a truncated or changed file would end every later flight with a traceback or an
illegal instruction.
"""

from __future__ import annotations

import linecache
import logging
import pickle
import sys
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from quadsim.files.atomic import replace_file
from quadsim.files.cache import cache_folder

SUM = sha256().digest_size
# Files whose functions are inlined into loops of other files; a change of these files makes all
# cached code invalid
INLINED = (
    "atomics.py",
    "episode_loops.py",
    "helpers.py",
    "normals.py",
    "race_loops.py",
    "sharing.py",
)
LARGEST = 50_000_000  # bytes that are read at most; the code of a planner has 300 000
# Without configured logging, a warning is one line on stderr.
log = logging.getLogger("quadsim")


class CodeCache(NullCache):
    """The compiled code of one function, with the interface of numba's caches."""

    # Whether this process has warned that code cannot be stored
    complained = False

    def __init__(self, function: Any):
        self._stem = self.stem(function.py_func)
        text = "".join(linecache.getlines(function.py_func.__code__.co_filename))
        options = {}
        for name, value in sorted(function.targetoptions.items()):
            options[name] = sorted(value) if isinstance(value, set) else value
        version = f"{numba.__version__} {sys.version_info[:2]}"
        self._made_of = f"{version} {options} {_inlined()} {text}"

    @staticmethod
    def stem(function: Any) -> str:
        """Return the beginning of the names of a function's files."""
        return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for this signature and this processor, None if no intact file exists."""
        target_context.refresh()
        path = self._path(sig, target_context.codegen())
        code = _read(path) if path else None
        if code is None:
            return None
        return CompileResult._rebuild(target_context, *pickle.loads(code))

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the code for this signature; warn once if that is not possible."""
        path = self._path(sig, data.codegen)
        # Numba cannot cache lifted loops and dynamic globals.
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
                f"{where}: cannot keep compiled code: {error.strerror}; "
                "each start compiles anew, some 15 s"
            )

    def _path(self, sig: Any, codegen: Any) -> Path | None:
        """Return the file of a signature, whose name has a digest of all inputs of the code."""
        folder = cache_folder()
        if folder is None:
            return None
        inputs = f"{self._made_of} {sig} {codegen.magic_tuple()}"
        digest = sha256(inputs.encode()).hexdigest()[:16]
        return folder / f"{self._stem}-{digest}.code"


@cache
def _inlined() -> str:
    """Return a digest of the content of the INLINED files."""
    digest = sha256()
    for name in INLINED:
        digest.update(Path(__file__).with_name(name).read_bytes())
    return digest.hexdigest()


def _read(path: Path) -> bytes | None:
    """Return the code in a file, None if it is missing or, with a warning, if it is damaged."""
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
    """Write the code of a file.

    Raises:
        OSError: the code cannot be written; no new folder is left.
    """
    made = [folder for folder in (path.parent, *path.parent.parents) if not folder.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        replace_file(path, sha256(code).digest() + code)
    except OSError:
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()
        raise
