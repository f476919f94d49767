"""Whether code is the user's own, or of Python, an installed package or this project.

The file that holds the code decides, not its name: a user's own `queue.py` is not Python's
`queue`, and a function that `functools.wraps` has given a library's name is still the user's.
"""

from __future__ import annotations

import builtins
import sys
import sysconfig
import traceback
import types
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

OWN_FOLDERS = ("", "controllers", "web")  # links, in a checkout
# Modules without a file, in which compiled packages keep their common types
COMPILERS = ("_cython", "pybind11")
# Flag of a class that was made while Python ran, and not compiled from C as a static type
HEAP_TYPE = 1 << 9


@cache
def _library_folders() -> tuple[Path, ...]:
    """Return the folders of Python's own modules, of installed packages and of this project."""
    names = ("stdlib", "platstdlib", "purelib", "platlib")
    own = Path(__file__).parents[1]
    folders = [sysconfig.get_path(name) for name in names] + [own / name for name in OWN_FOLDERS]
    return tuple(Path(folder).resolve() for folder in folders)


@cache
def is_library_file(file: str) -> bool:
    """Return whether a file of code is Python's, an installed package's or this project's."""
    if file.startswith("<"):  # code without a file
        return file.startswith("<frozen ")
    folders = Path(file).resolve().parents
    return any(folder in folders for folder in _library_folders())


def is_library(module: str | None) -> bool:
    """Return whether the module of a name is Python's, an installed package's or this project's."""
    if module is None or module in ("__main__", "__mp_main__"):
        return False
    package = module.partition(".")[0]
    if package.startswith(COMPILERS):
        return True
    loaded = sys.modules.get(module) or sys.modules.get(package)
    if loaded is None:
        return package in sys.stdlib_module_names and _is_library_found(package)
    return is_library_module(loaded)


def is_library_module(module: types.ModuleType) -> bool:
    """Return whether a loaded module is Python's, an installed package's or this project's."""
    file = getattr(module, "__file__", None)
    if file is not None:
        return is_library_file(file)
    # Modules of the interpreter have no file; nor has a user's own that was made in Python.
    origin = getattr(getattr(module, "__spec__", None), "origin", None)
    return module.__name__.startswith(COMPILERS) or origin in ("built-in", "frozen")


def _is_library_found(package: str) -> bool:
    """Return whether an import of this name would load a module of Python, not a user's file."""
    found = find_spec(package)
    origin = found.origin if found else None
    return origin in ("built-in", "frozen") or (origin is not None and is_library_file(origin))


def is_of_library(made: Any) -> bool:
    """Return whether a class or function is a library's."""
    if not isinstance(made.__module__, str | None):  # a class that is written in C
        return True
    # `make_dataclass` says that the classes it makes are of the module `types`
    if made.__module__ == "types" and not hasattr(types, made.__name__):
        return False
    if isinstance(made, types.FunctionType):
        return is_library(made.__module__) and not _is_own_code(made, made)
    if made.__module__ == "builtins":
        # A class of `exec(code, {})` says that it is a builtin
        is_static = not made.__flags__ & HEAP_TYPE
        return is_static or getattr(builtins, made.__qualname__, None) is made
    if not is_library(made.__module__):
        return False
    if made.__module__ and _named(made.__module__, made.__qualname__) is made:
        return True
    # A class that was given a library's name has methods of the user's
    methods = [value for value in vars(made).values() if isinstance(value, types.FunctionType)]
    return not any(_is_own_code(method, made) for method in methods)


def _is_own_code(function: types.FunctionType, named: Any) -> bool:
    """Return whether a function's code is the user's, whatever its name says.

    Args:
        function: the function.
        named: the function, or the class that has it.
    """
    file = function.__code__.co_filename
    if not file.startswith("<") or is_library_file(file):
        return not is_library_file(file)
    # Code without a file is a library's if the library has the function under its name
    return _named(named.__module__, named.__qualname__) is not named


def _named(module: str, qualname: str) -> object:
    """Return what a loaded module has under a name, None if it has nothing."""
    found: object = sys.modules.get(module)
    for name in qualname.split("."):
        found = getattr(found, name, None)
    return found


def place_in_own_code(error: BaseException) -> str | None:
    """Return where the user's own code has raised an error, such as "mine.py, line 12".

    None: no code of the user's was running.
    """
    frames = traceback.extract_tb(error.__traceback__)
    own = [
        frame
        for frame in frames
        if not frame.filename.startswith("<") and not is_library_file(frame.filename)
    ]
    return f"{Path(own[-1].filename).name}, line {own[-1].lineno}" if own else None


def error_text(error: Exception) -> str:
    """Return an error on one line, with its type and place if the user's own code has raised it."""
    text = " ".join("; ".join([str(error), *getattr(error, "__notes__", [])]).split())
    place = place_in_own_code(error)
    return text if place is None else f"{type(error).__name__}: {text} ({place})"
