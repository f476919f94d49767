"""Compiled code, and generated modules that are compiled."""

from __future__ import annotations

import inspect
import linecache
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from controllers.lanes.code_cache import CodeCache, cache_folder


def kept(function: Any) -> Any:
    """Keep the compiled code on the disk for the next process, and let Ctrl-C end compiling.

    This is a decorator above numba's njit.
    """
    compile_ = function.compile

    def compiled(signature: Any) -> Any:
        with interruptible():
            return compile_(signature)

    function._cache = CodeCache(function)
    function.compile = compiled
    return function


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt at the end if the code inside has swallowed one, or failed for it.

    An exception that a signal raises inside a callback of LLVM is printed and forgotten, as in any
    callback from C.
    """
    before = signal.getsignal(signal.SIGINT)
    came: list[int] = []
    if not callable(before) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupted(number: int, frame: Any) -> None:
        came.append(number)
        before(number, frame)

    signal.signal(signal.SIGINT, interrupted)
    try:
        yield
    except Exception:
        # The compiler fails where an interrupted callback left its work undone.
        if not came:
            raise
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        raise KeyboardInterrupt


def load_module(name: str, source: str) -> ModuleType:
    """Return the module with this text.

    No file is written; tracebacks and compilers find its lines by `linecache`.
    """
    module = ModuleType(name)
    module.__file__ = f"<{name}>"
    linecache.cache[module.__file__] = (
        len(source),
        None,
        source.splitlines(keepends=True),
        module.__file__,
    )
    sys.modules[name] = module  # compiled code is unpickled by module name
    exec(compile(source, module.__file__, "exec"), module.__dict__)
    return module


def is_cached(function: Callable) -> bool:
    """Return whether code of this function is on the disk, so that its first call is quick."""
    folder = cache_folder()
    if folder is None:
        return False
    stem = CodeCache.stem(inspect.unwrap(function))
    return any(folder.glob(f"{stem}-*"))
