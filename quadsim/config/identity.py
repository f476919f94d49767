"""The identity of an object: a hash of all that it computes with.

Two of the user's own parts have the same identity only if they behave alike. An object is pickled,
together with the code that it runs: functions by their compiled code, their closure, their defaults
and the globals that they use, classes by their bases and attributes, and the user's own modules
whole. Code of Python, of installed packages and of this project counts by name and version, since
the versions are recorded beside each flight.

An object that Python cannot pickle, such as an open file, has no identity, and neither has one that
contains itself. The code counts as it was loaded: a file that was edited after its import has not
changed what flies.

Whether code is the user's is decided by the file that holds it, not by its name: a user's own
`queue.py` is not Python's `queue`, and a function that `functools.wraps` has given a library's name
is still the user's.
"""

from __future__ import annotations

import builtins
import dataclasses
import dis
import functools
import pickle
import sys
import sysconfig
import traceback
import types
from collections.abc import Iterator
from functools import cache, singledispatch
from hashlib import sha256
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

MOST_OBJECTS = 10_000_000  # in one identity
# Types that are pickled as they are
PLAIN = (type(None), bool, int, float, complex, str, bytes, list, tuple, dict)
# Attributes of a class that do not change what it computes, or that Python writes at its first use
IGNORED = frozenset(
    (
        *("__annotate_func__", "__annotations__", "__annotations_cache__", "__dict__", "__doc__"),
        *("__firstlineno__", "__module__", "__orig_bases__", "__parameters__", "__qualname__"),
        *("__protocol_attrs__", "__slotnames__", "__static_attributes__", "__type_params__"),
        *("__weakref__", "_abc_impl"),
    )
)
# Functions of Python by which code reads globals that it does not name
READERS = frozenset(("eval", "exec", "globals", "locals", "vars"))
OWN_FOLDERS = ("", "controllers", "web")  # links, in a checkout
# Modules without a file, in which compiled packages keep their common types
COMPILERS = ("_cython", "pybind11")
# Flag of a class that was made while Python ran, and not compiled from C as a static type
HEAP_TYPE = 1 << 9


class IdentityError(ValueError):
    """An object cannot be told from others. The message says why."""


def identity_of(part: object) -> str:
    """Return the hash of an object, the same in every process that has loaded the same code.

    Raises:
        IdentityError: the state of the object, or of one that it holds, cannot be told.
    """
    try:
        return _digest(part)
    except Exception as error:  # the `__reduce__` of an object may raise anything
        problem = f"its state is unknown: {' '.join(str(error).split())}"
        # The pickler finds lists and mappings within themselves, Python anything else.
        if isinstance(error, RecursionError) or "cyclic" in problem:
            problem = "expected an object that does not contain itself and is not deeply nested"
        raise IdentityError(f"{type(part).__name__}: {problem}") from None


def _digest(part: object) -> str:
    """Return the hash of an object. Raises whatever its pickling raises."""
    file = BytesIO()
    _CodePickler(file).dump(part)
    return sha256(file.getbuffer()).hexdigest()


class _CodePickler(pickle.Pickler):
    """A pickler that writes code too, and nothing that differs between two processes."""

    def __init__(self, file: BytesIO):
        super().__init__(file, protocol=4)
        # Without a memo, one object that is held twice is written like two equal objects.
        self.fast = True
        # Functions, classes and modules refer to themselves. Each is written once, and by its
        # number from then on: id -> number, object. The object is kept, so that its id is its own.
        self._numbered: dict[int, tuple[int, object]] = {}
        self._count = 0

    def persistent_id(self, value: Any) -> object:
        """Return what is written in place of an object, None if it is pickled as usual."""
        self._count += 1
        if self._count > MOST_OBJECTS:
            raise IdentityError(f"expected at most {MOST_OBJECTS} objects within each other")
        if type(value) in PLAIN:
            return None
        if isinstance(value, type | types.FunctionType | types.ModuleType):
            if id(value) in self._numbered:
                return ("number", self._numbered[id(value)][0])
            self._numbered[id(value)] = (len(self._numbered), value)
        return _written(value)


def _object(value: Any) -> object:
    """Return the class and the state of an object, None for an object of a library."""
    kind: type = type(value)
    module = str(getattr(kind, "__module__", ""))
    if module == "typing":
        return ("typing", repr(value))
    if module.partition(".")[0] == "numba":
        return _compiled(value)
    if is_of_library(kind):
        return ("record", kind, _state(value)) if dataclasses.is_dataclass(kind) else None
    # By name, even if the object says how it wants to be pickled
    state = ("object", kind, _state(value))
    if all(base is object or not is_of_library(base) for base in kind.__mro__):
        return state
    # The content of a list, an array or the like, of which the class is derived, as the library
    # tells it: the user's class may tell less
    library: Any = next(base for base in kind.__mro__ if is_of_library(base))
    content = library.__reduce_ex__(value, pickle.DEFAULT_PROTOCOL)
    return (state, [list(part) if isinstance(part, Iterator) else part for part in content])


_written = singledispatch(_object)


@_written.register(set)
@_written.register(frozenset)
def _set(value: Any) -> object:
    return (type(value), sorted(map(_digest, value)), _state(value))


@_written.register
def _array(value: np.ndarray) -> object:
    if type(value) is not np.ndarray:
        return _object(value)
    if value.dtype.hasobject:
        return None
    return ("array", str(value.dtype), value.shape, value.tobytes())


@_written.register
def _ufunc(value: np.ufunc) -> object:
    libraries = (np, sys.modules.get("scipy.special"))
    if value not in [getattr(library, value.__name__, None) for library in libraries]:
        raise IdentityError(f"the code of the ufunc {value.__name__} is unknown")
    return ("ufunc", value.__name__)


@_written.register
def _module(value: types.ModuleType) -> object:
    """Return a library's name and version, or all that one of the user's own modules has."""
    if is_library_module(value):
        return ("module", _with_version(value.__name__))
    names = sorted(filter(_is_own_name, vars(value)))
    return ("module", {name: vars(value)[name] for name in names})


@_written.register
def _function(value: types.FunctionType) -> object:
    """Return a function's code with all that it uses; of a library's function, its name."""
    if is_of_library(value):
        # A function that a library has made, such as a decorator's, may hold one of the user's
        held = (value.__closure__, getattr(value, "__wrapped__", None))
        return ("function", _with_version(value.__module__), value.__qualname__, held)
    defaults = (value.__defaults__, value.__kwdefaults__)
    held = (value.__closure__, dict(vars(value)))
    named = _names(value.__code__)
    known = value.__globals__.keys()
    names = sorted(filter(_is_own_name, known) if named & READERS else named & known)
    used = {name: value.__globals__[name] for name in names}
    modules = [_imported(name) for name in sorted(_imports(value.__code__))]
    return ("function", value.__code__, defaults, held, used, modules)


@_written.register
def _code(code: types.CodeType) -> object:
    """Return what a compiled function does; not its name, and not where it stands."""
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    steps = (code.co_code, code.co_exceptiontable, code.co_flags)
    return ("code", steps, names, counts, code.co_consts)


@_written.register
def _class(kind: type) -> object:
    """Return a class's bases and attributes; of a library's class, its name."""
    if is_of_library(kind):
        return ("class", _with_version(kind.__module__), kind.__qualname__)
    names = {name: value for name, value in sorted(vars(kind).items()) if name not in IGNORED}
    return ("class", kind.__qualname__, type(kind), kind.__bases__, names)


@_written.register
def _field(value: dataclasses.Field) -> object:
    return ("field", value.name, value.default, value.default_factory, value.metadata)


@_written.register
def _method(value: types.MethodType) -> object:
    return ("method", value.__func__, value.__self__)


@_written.register(staticmethod)
@_written.register(classmethod)
def _unbound(value: Any) -> object:
    return (type(value), value.__func__)


@_written.register
def _property(value: property) -> object:
    return (type(value), value.fget, value.fset, value.fdel)


@_written.register
def _cached_property(value: functools.cached_property) -> object:
    return (type(value), value.func)


@_written.register
def _cached(value: functools._lru_cache_wrapper) -> object:
    return ("cached", value.__wrapped__, value.cache_parameters())


@_written.register
def _proxy(value: types.MappingProxyType) -> object:
    return ("mapping", dict(value))


@_written.register
def _cell(value: types.CellType) -> object:
    try:
        return ("cell", value.cell_contents)
    except ValueError:  # a variable without a value yet
        return ("cell",)


def _compiled(value: Any) -> object:
    """Return the function that numba has compiled, and how. Its other objects are unknown."""
    function = getattr(value, "py_func", None)
    if not isinstance(function, types.FunctionType):
        raise IdentityError(f"a {type(value).__name__} of numba is no function")
    return ("compiled", function, dict(value.targetoptions))


def _state(value: object) -> dict[str, object]:
    """Return an object's attributes by name, without those that a property has computed."""
    if dataclasses.is_dataclass(value) and is_of_library(type(value)):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    state: Any = object.__getstate__(value)
    attributes, slots = state if isinstance(state, tuple) else (state, None)
    names: dict[str, object] = {**(attributes or {}), **(slots or {})}
    computed = {
        name
        for base in type(value).__mro__
        for name, attribute in vars(base).items()
        if isinstance(attribute, functools.cached_property)
    }
    return {name: names[name] for name in sorted(names.keys() - computed)}


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    """Yield code, and that of the functions within it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _codes(constant)


def _names(code: types.CodeType) -> set[str]:
    """Return the globals and attributes that code names."""
    return {name for one in _codes(code) for name in one.co_names}


def _is_own_name(name: str) -> bool:
    """Return whether Python itself has not given a module this name."""
    return not name.startswith("__")


def _imports(code: types.CodeType) -> set[str]:
    """Return the modules that code imports."""
    steps = (step for one in _codes(code) for step in dis.get_instructions(one))
    return {str(step.argval) for step in steps if step.opname == "IMPORT_NAME"}


def _imported(name: str) -> object:
    """Return the name of a library's module, or one of the user's modules. Raises IdentityError."""
    if is_library(name):
        return name
    if name not in sys.modules:
        raise IdentityError(f"the module {name} is imported later")
    return sys.modules[name]


def _with_version(module: str | None) -> str:
    """Return the name of a module with the version of its package, if that has one."""
    if module is None:
        return "unknown"
    package = sys.modules.get(module.partition(".")[0])
    return f"{module} {getattr(package, '__version__', '')}"


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


def is_library(name: str | None) -> bool:
    """Return whether the module of a name is Python's, an installed package's or this project's."""
    if name is None or name in ("__main__", "__mp_main__"):
        return False
    package = name.partition(".")[0]
    loaded = sys.modules.get(name) or sys.modules.get(package)
    if loaded is not None:
        return is_library_module(loaded)
    if package.startswith(COMPILERS):
        return True
    # What an import of this name would load: a user's file may come before one of Python's.
    origin = getattr(find_spec(package) if package else None, "origin", None)
    return origin in ("built-in", "frozen") or (origin is not None and is_library_file(origin))


def is_library_module(module: types.ModuleType) -> bool:
    """Return whether a loaded module is Python's, an installed package's or this project's."""
    file = getattr(module, "__file__", None)
    if file is not None:
        return is_library_file(file)
    # Modules of the interpreter have no file; nor has a user's own that was made in Python.
    origin = getattr(getattr(module, "__spec__", None), "origin", None)
    return module.__name__.startswith(COMPILERS) or origin in ("built-in", "frozen")


def is_of_library(made: Any) -> bool:
    """Return whether a class or function is a library's."""
    name = getattr(made, "__module__", None)
    if not isinstance(name, str | None):  # a class that is written in C
        return True
    # `make_dataclass` says that the classes it makes are of the module `types`
    if name == "types" and not hasattr(types, made.__name__):
        return False
    if isinstance(made, types.FunctionType):
        return is_library(name) and not _is_own_code(made, made)
    if name == "builtins":
        # A class of `exec(code, {})` says that it is a builtin
        is_static = not made.__flags__ & HEAP_TYPE
        return is_static or getattr(builtins, made.__qualname__, None) is made
    if not is_library(name):
        return False
    if _found(name, made.__qualname__) is made:
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
    return _found(named.__module__, named.__qualname__) is not named


def _found(module: str | None, qualname: str) -> object:
    """Return what a loaded module has under a name, None if it has nothing."""
    found: object = sys.modules.get(module or "")
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
