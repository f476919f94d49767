"""Generated modules on disk, so that their compiled code is found again by the next process."""

from __future__ import annotations

import importlib.util
import inspect
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import ModuleType


def cache_folder() -> Path:
    """Where generated code lives: $XDG_CACHE_HOME/quadsim, or a folder of this user's under /tmp."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "quadsim"
    try:
        home.mkdir(parents=True, exist_ok=True)
        writable = os.access(home, os.W_OK)
    except OSError:
        writable = False
    if writable:
        return home
    return Path(tempfile.mkdtemp(prefix="quadsim-"))


def load_module(name: str, source: str) -> ModuleType:
    """Import `source` from a file of this name, written whole or not at all (two processes may race)."""
    path = cache_folder() / f"{name}.py"
    if not path.exists():
        handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
        with os.fdopen(handle, "w") as file:
            file.write(source)
        os.replace(temporary, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # numba's cache unpickles compiled code by module name
    spec.loader.exec_module(module)
    return module


def is_cached(function: Callable) -> bool:
    """Whether numba finds compiled code of this function on the disk, so that its first call is quick."""
    source = Path(inspect.getfile(inspect.unwrap(function)))
    folder = Path(function._cache.cache_path)  # pyright: ignore[reportFunctionMemberAccess]
    return any(folder.glob(f"{source.stem}.{function.__name__}-*.nbi"))
