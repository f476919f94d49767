"""Compilation of functions and of generated modules."""

from __future__ import annotations

import gc
import inspect
import linecache
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from numba.core.compiler_lock import global_compiler_lock
from numba.core.errors import NumbaError
from numba.core.targetconfig import ConfigStack
from numba.core.types import BaseFunction

from quadsim.controllers.lanes.code_cache import CodeCache
from quadsim.controllers.lanes.trace import TraceError
from quadsim.files.cache import cache_folder

COLOUR = re.compile("\x1b\\[[0-9;]*m")  # of numba's errors in a terminal

# Steps of numba that the loops do not need, and that take a tenth of the compile time: an entry for
# callbacks from C, and the rewriting of expressions over whole arrays and of `raise`
SPARED = {"no_cfunc_wrapper": True, "no_rewrites": True}


def kept(function: Any) -> Any:
    """Cache the compiled code on the disk, and make the compilation interruptible by Ctrl-C.

    This is a decorator above numba's njit, for a function without a statement `raise`.
    """
    function.targetoptions.update(SPARED)
    compile_ = function.compile

    def compiled(signature: Any) -> Any:
        try:
            with interruptible(), faster_compiler():
                return compile_(signature)
        except NumbaError as error:
            raise TraceError(_refused(error)) from None

    function._cache = CodeCache(function)
    function.compile = compiled
    return function


def _refused(error: NumbaError) -> str:
    """Return the compiler's error on one line, with function and line of the generated text."""
    texts = (line.strip() for line in COLOUR.sub("", str(error)).splitlines())
    problem = next((text for text in texts if text and not text.startswith("Failed in")), "")
    place = getattr(error, "loc", None)
    if place is None:
        return f"numba cannot compile this: {problem}"
    line = linecache.getline(place.filename, place.line).strip()
    # A comment above each part of the text names its source function.
    above = (linecache.getline(place.filename, k).strip() for k in range(place.line, 0, -1))
    part = next((text for text in above if text.startswith("# ")), "")
    return f"{part[2:]}: numba cannot compile the line `{line}`: {problem}".removeprefix(": ")


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise KeyboardInterrupt at the end of the context if the code inside has suppressed it.

    An exception that a signal raises inside a callback from LLVM is printed and dropped, as in any
    callback from C, or leads to another error.
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
        # The compiler fails if an interrupted callback did not finish its work.
        if not came:
            raise
    finally:
        signal.signal(signal.SIGINT, before)
    if came:
        raise KeyboardInterrupt


@contextmanager
def faster_compiler() -> Iterator[None]:
    """Let numba make the same code in three quarters of the time.

    For each operation of the text, numba tries all overloads that the operation has. In here, the
    result is kept for the next operation on the same types. The garbage collector is off, because
    it would search the growing data of the compiler again and again.
    """
    found: dict[tuple[Any, ...], Any] = {}
    alive: list[Any] = []  # whose ids are in `found`
    find = BaseFunction.get_call_type

    def find_once(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws:
            return find(self, context, args, kws)
        options = ConfigStack.top_or_none()
        key = id(self), id(options), args
        if key not in found:
            found[key] = find(self, context, args, kws)
            alive.extend((self, options))
        return found[key]

    with global_compiler_lock:
        collects = gc.isenabled()
        gc.disable()
        BaseFunction.get_call_type = find_once
        try:
            yield
        finally:
            BaseFunction.get_call_type = find
            if collects:
                gc.enable()


def load_module(name: str, source: str) -> ModuleType:
    """Return the module with a source text.

    No file is written; tracebacks and compilers read the lines through `linecache`.
    """
    module = ModuleType(name)
    module.__file__ = f"<{name}>"
    linecache.cache[module.__file__] = (
        len(source),
        None,
        source.splitlines(keepends=True),
        module.__file__,
    )
    sys.modules[name] = module  # cached code is unpickled by module name
    exec(compile(source, module.__file__, "exec"), module.__dict__)
    return module


def is_cached(function: Callable) -> bool:
    """Return whether a function's code is in the cache, so that its first call is fast."""
    folder = cache_folder()
    if folder is None:
        return False
    stem = CodeCache.stem(inspect.unwrap(function))
    return any(folder.glob(f"{stem}-*"))
