"""The identity of an object: a hash of all that it computes with.

Two of the user's own parts have the same identity only if they behave alike: arrays count whole,
functions by their compiled code, their closure, their defaults and the globals that they use,
classes by their methods, objects by their class and state, and the user's own modules whole. An
object whose state Python cannot tell, such as an open file or a running generator, has no identity.

The code counts as it was loaded: a file that was edited after its import has not changed what
flies. Modules of Python, of installed packages and of this project count by name and version, since
their versions are recorded beside each flight.
"""

from __future__ import annotations

import dataclasses
import dis
import enum
import functools
import re
import sys
import types
from collections.abc import Iterable, Iterator, Mapping
from functools import singledispatchmethod
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from quadsim.config.first_names import first_name
from quadsim.config.library_code import is_library, is_library_module, is_of_library

MOST_DEPTH = 60  # of objects within objects
MOST_OBJECTS = 100_000  # in one walk
DATACLASSES = dataclasses.__file__
# Attributes of a class that do not change what it computes
IGNORED = frozenset(
    {
        "__abstractmethods__",
        "__annotate_func__",
        "__annotations__",
        "__annotations_cache__",
        "__dataclass_params__",
        "__dict__",
        "__doc__",
        "__firstlineno__",
        "__match_args__",
        "__module__",
        "__orig_bases__",
        "__parameters__",
        "__protocol_attrs__",
        "__qualname__",
        "__signature__",
        "__slotnames__",
        "__slots__",
        "__static_attributes__",
        "__weakref__",
        "_abc_impl",
    }
)
COLLECTIONS = (list, tuple, set, frozenset)
MAPPINGS = (dict, types.MappingProxyType)
# Types whose values are told by their text
TEXTUAL = (
    type(None),
    bool,
    int,
    float,
    complex,
    str,
    types.EllipsisType,
    types.NotImplementedType,
    range,
    slice,
)
# Methods that the decorator `dataclass` writes
GENERATED = frozenset(
    {"__init__", "__repr__", "__eq__", "__lt__", "__le__", "__gt__", "__ge__", "__hash__"}
    | {"__setattr__", "__delattr__", "__replace__", "__getstate__", "__setstate__"}
)


class IdentityError(ValueError):
    """An object cannot be told from others. The message says which part of it, and why."""


def identity_of(part: object) -> str:
    """Return the hash of an object, the same in every process that has loaded the same code.

    Raises:
        IdentityError: the state of the object, or of one that it holds, cannot be told.
    """
    return _Walk().digest(part, type(part).__name__)


class _Walk:
    """One walk through an object and all that it refers to.

    The digest of an object is the hash of its kind and of the digests of its parts. An object that
    contains itself is named by how far up it was met.
    """

    def __init__(self) -> None:
        self._path: list[object] = []  # from the outermost object to the present one
        # The number of objects above the highest one that the present object has named as above it
        self._highest = MOST_DEPTH
        self._count = 0
        # Digest of each object by its id, and the objects, so that no id is used twice
        self._known: dict[int, str] = {}
        self._kept: list[object] = []

    def digest(self, value: object, place: str) -> str:
        """Return the digest of an object.

        Args:
            value: the object.
            place: where it was met, such as "Held.table[3]", for the error.
        """
        plain = _plain(value)
        if plain is not None:
            return plain
        if id(value) in self._known:
            return self._known[id(value)]
        depth = len(self._path)
        for outer in range(depth):
            if self._path[outer] is value:
                self._highest = min(self._highest, outer)
                return _hash("above", str(depth - outer))
        self._count += 1
        if depth == MOST_DEPTH or self._count > MOST_OBJECTS:
            most = f"{MOST_OBJECTS} objects, {MOST_DEPTH} of them within each other"
            raise IdentityError(f"{place}: expected at most {most}")

        before = self._highest
        self._highest = MOST_DEPTH
        self._path.append(value)
        try:
            found = _hash(*self._parts(value, place))
        finally:
            self._path.pop()
        # A digest that names an object above holds only in this place
        if self._highest >= depth:
            self._known[id(value)] = found
            self._highest = MOST_DEPTH
        self._highest = min(self._highest, before)
        self._kept.append(value)
        return found

    @singledispatchmethod
    def _parts(self, value: Any, place: str) -> Iterator[str]:
        """Yield what the digest of an object is made of."""
        yield from self._object(value, place)

    @_parts.register(np.ndarray)
    def _array(self, value: np.ndarray, place: str) -> Iterator[str]:
        if type(value) is not np.ndarray or value.dtype.hasobject:
            yield from self._object(value, place)
            return
        yield from ("array", str(value.dtype), str(value.shape))
        yield sha256(np.ascontiguousarray(value).tobytes()).hexdigest()

    @_parts.register(list)
    @_parts.register(tuple)
    @_parts.register(set)
    @_parts.register(frozenset)
    def _collection(self, value: Any, place: str) -> Iterator[str]:
        if type(value) not in COLLECTIONS:
            yield from self._object(value, place)
            return
        yield type(value).__name__
        items = self._items(value, place)
        yield from sorted(items) if isinstance(value, set | frozenset) else items

    @_parts.register(dict)
    @_parts.register(types.MappingProxyType)
    def _mapping(self, value: Any, place: str) -> Iterator[str]:
        if type(value) not in MAPPINGS:
            yield from self._object(value, place)
            return
        yield "mapping"
        for key, inner in value.items():
            yield self.digest(key, place)
            yield self.digest(inner, f"{place}.{_shown(key)}")

    @_parts.register
    def _module(self, value: types.ModuleType, place: str) -> Iterator[str]:
        """Yield a library's name and version, and all that one of the user's own modules has."""
        yield from ("module", _module_version(value))
        if not is_library_module(value):
            names = {name: inner for name, inner in vars(value).items() if not _is_special(name)}
            yield from self._pairs(names, value.__name__)

    @_parts.register
    def _method(self, value: types.MethodType, place: str) -> Iterator[str]:
        yield "method"
        yield self.digest(value.__func__, place)
        yield self.digest(value.__self__, place)

    @_parts.register
    def _builtin(self, value: types.BuiltinFunctionType, place: str) -> Iterator[str]:
        yield from ("builtin", value.__qualname__)
        yield self.digest(value.__self__, place)

    @_parts.register(types.MethodDescriptorType)
    @_parts.register(types.WrapperDescriptorType)
    @_parts.register(types.ClassMethodDescriptorType)
    @_parts.register(types.GetSetDescriptorType)
    @_parts.register(types.MemberDescriptorType)
    def _named(self, value: object, place: str) -> Iterator[str]:
        """Yield the name of a callable that is written in C and has no state."""
        yield from ("named", _without_addresses(value))

    @_parts.register
    def _ufunc(self, value: np.ufunc, place: str) -> Iterator[str]:
        special = sys.modules.get("scipy.special")
        if value not in (getattr(np, value.__name__, None), getattr(special, value.__name__, None)):
            raise IdentityError(f"{place}: the code of the ufunc {value.__name__} is unknown")
        yield from ("ufunc", value.__name__)

    @_parts.register(staticmethod)
    @_parts.register(classmethod)
    def _unbound(self, value: Any, place: str) -> Iterator[str]:
        yield type(value).__name__
        yield self.digest(value.__func__, place)

    @_parts.register
    def _property(self, value: property, place: str) -> Iterator[str]:
        yield "property"
        for accessor in (value.fget, value.fset, value.fdel):
            yield self.digest(accessor, place)

    @_parts.register
    def _cached_property(self, value: functools.cached_property, place: str) -> Iterator[str]:
        yield "cached_property"
        yield self.digest(value.func, place)

    @_parts.register
    def _cell(self, value: types.CellType, place: str) -> Iterator[str]:
        yield "cell"
        if not _is_empty(value):
            yield self.digest(value.cell_contents, place)

    @_parts.register
    def _member(self, value: enum.Enum, place: str) -> Iterator[str]:
        yield "member"
        yield self.digest(type(value), place)
        yield value.name

    def _items(self, values: Iterable[object], place: str) -> Iterator[str]:
        for number, value in enumerate(values):
            yield self.digest(value, f"{place}[{number}]")

    def _pairs(self, values: Any, place: str) -> Iterator[str]:
        """Yield the names of attributes and the digests of their values, by name."""
        for name in sorted(values):
            yield name
            yield self.digest(values[name], f"{place}.{name}")

    @_parts.register
    def _code(self, code: types.CodeType, place: str) -> Iterator[str]:
        """Yield what a compiled function does; not its name, and not where it stands."""
        yield "code"
        yield sha256(code.co_code).hexdigest()
        yield sha256(getattr(code, "co_exceptiontable", b"")).hexdigest()
        for names in (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars):
            yield ",".join(names)
        counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
        yield ",".join(map(str, counts))
        yield from self._items(code.co_consts, place)

    @_parts.register
    def _function(self, function: types.FunctionType, place: str) -> Iterator[str]:
        """Yield a function's code, its defaults, its closure and the globals that it uses."""
        if is_of_library(function):
            yield from ("function", _module_version(sys.modules.get(function.__module__)))
            yield function.__qualname__
            # A function that a library has made, such as a decorator's, may hold one of the user's
            held = (function.__closure__, getattr(function, "__wrapped__", None))
            yield self.digest(held, place)
            return
        yield "function"
        place = f"{place} {function.__qualname__}" if place else function.__qualname__
        yield self.digest(function.__code__, place)
        yield self.digest(function.__defaults__, place)
        yield self.digest(function.__kwdefaults__, place)
        yield self.digest(function.__closure__, place)
        yield self.digest(dict(function.__dict__), place)
        yield from self._globals(function, place)

    def _globals(self, function: types.FunctionType, place: str) -> Iterator[str]:
        """Yield the globals that a function's code names, and the modules that it imports."""
        for name in sorted(_names(function.__code__)):
            if name in function.__globals__:
                yield name
                yield self.digest(function.__globals__[name], f"{place} {name}")
        for name in sorted(_imports(function.__code__)):
            yield name
            if not is_library(name):
                module = sys.modules.get(name)
                if module is None:
                    raise IdentityError(f"{place}: the module {name} is imported later")
                yield self.digest(module, name)

    @_parts.register
    def _class(self, kind: type, place: str) -> Iterator[str]:
        """Yield a class's bases and attributes; of a library's class, its name and version."""
        yield "class"
        yield kind.__qualname__
        if is_of_library(kind):
            yield _module_version(sys.modules.get(kind.__module__))
            return
        yield self.digest(type(kind), place)
        yield from self._items(kind.__bases__, place)
        for name, value in sorted(vars(kind).items()):
            if name in IGNORED or _is_generated(kind, name, value):
                continue
            yield name
            if name == "__dataclass_fields__":
                for field in value.values():
                    yield field.name
                    yield self.digest(field.default, f"{place}.{field.name}")
                    yield self.digest(field.default_factory, f"{place}.{field.name}")
                continue
            yield self.digest(value, f"{kind.__qualname__}.{name}")

    def _object(self, value: object, place: str) -> Iterator[str]:
        """Yield an object's class and state."""
        kind = type(value)
        yield "object"
        yield self.digest(kind, place)
        if isinstance(value, functools._lru_cache_wrapper):
            yield self.digest(value.__wrapped__, place)
            yield self.digest(value.cache_parameters(), place)
            return
        if kind.__module__.partition(".")[0] == "numba":
            yield from self._compiled(value, place)
            return
        # The state of a user's object by name, even if it says how it wants to be pickled
        if not is_of_library(kind):
            state = _without_caches(kind, getattr(value, "__dict__", {}))
            state |= {slot: getattr(value, slot) for slot in _slots(kind) if hasattr(value, slot)}
            yield from self._pairs(state, place)
            if all(base is object or not is_of_library(base) for base in kind.__mro__):
                return
        # A library's record by its fields
        if dataclasses.is_dataclass(value):
            for field in dataclasses.fields(value):
                yield field.name
                yield self.digest(getattr(value, field.name), f"{place}.{field.name}")
            return
        # Any other object of a library by what it would be pickled as
        try:
            reduced = value.__reduce_ex__(4)
        except (TypeError, ValueError, AttributeError, NotImplementedError) as error:
            reason = " ".join(str(error).split())
            raise IdentityError(
                f"{place}: the state of a {kind.__name__} is unknown: {reason}"
            ) from None
        if isinstance(reduced, str):
            yield reduced
            return
        for part in reduced:
            # Items of lists and mappings come as iterators
            items = list(part) if isinstance(part, Iterator) else part
            yield self.digest(items, place)

    def _compiled(self, value: Any, place: str) -> Iterator[str]:
        """Yield the function that numba has compiled, and how. Its other objects are unknown."""
        if not isinstance(getattr(value, "py_func", None), types.FunctionType):
            raise IdentityError(f"{place}: the state of a {type(value).__name__} is unknown")
        yield self.digest(value.py_func, place)
        yield self.digest(dict(value.targetoptions), place)


def _plain(value: object) -> str | None:
    """Return the digest of a number, a text or the like; None for any other object."""
    kind = type(value)
    if kind in TEXTUAL:
        text = repr(value)
    elif kind in (bytes, bytearray):
        text = sha256(value).hexdigest()  # pyright: ignore[reportArgumentType] (kind says so)
    elif isinstance(value, np.generic) and not value.dtype.hasobject:
        text = f"{value.dtype} {sha256(value.tobytes()).hexdigest()}"
    elif isinstance(value, Path):
        text = str(value)
    elif kind.__module__ == "typing" or isinstance(value, types.GenericAlias | types.UnionType):
        text = _without_addresses(value)
    else:
        return None
    return _hash(kind.__name__, text)


def _without_addresses(value: object) -> str:
    """Return the text of an object without places in memory."""
    return re.sub(r" at 0x[0-9a-fA-F]+", "", repr(value))


def _hash(*parts: str) -> str:
    """Return the sha256 of texts, which are told apart by their lengths [hex]."""
    found = sha256()
    for part in parts:
        data = part.encode(errors="surrogatepass")
        found.update(len(data).to_bytes(8, "little"))
        found.update(data)
    return found.hexdigest()


def _names(code: types.CodeType) -> set[str]:
    """Return the globals and attributes that code names, functions within it included."""
    found = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found |= _names(constant)
    return found


def _without_caches(kind: type, state: Mapping[str, object]) -> dict[str, object]:
    """Return an object's attributes without those that a property computes at its first use."""
    caches = {
        name
        for base in kind.__mro__
        for name, value in vars(base).items()
        if isinstance(value, functools.cached_property)
    }
    return {name: value for name, value in state.items() if name not in caches}


def _imports(code: types.CodeType) -> set[str]:
    """Return the modules that code imports, functions within it included."""
    found = {
        str(step.argval) for step in dis.get_instructions(code) if step.opname == "IMPORT_NAME"
    }
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found |= _imports(constant)
    return found


def _shown(key: object) -> str:
    """Return a mapping's key for the place in an error."""
    return key if isinstance(key, str) else type(key).__name__


def _is_special(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")


def _slots(kind: type) -> list[str]:
    """Return the attributes that a class and its bases keep in slots."""
    found: list[str] = []
    for base in kind.__mro__:
        slots = vars(base).get("__slots__", ())
        for name in [slots] if isinstance(slots, str) else slots:
            is_private = name.startswith("__") and not name.endswith("__")
            found.append(f"_{base.__name__.lstrip('_')}{name}" if is_private else name)
    return [name for name in found if name not in ("__dict__", "__weakref__")]


def _is_generated(kind: type, name: str, value: object) -> bool:
    """Return whether `dataclass` has written this method: the fields say what it does."""
    if name not in GENERATED or not hasattr(kind, "__dataclass_fields__"):
        return False
    if value is None or not isinstance(value, types.FunctionType):
        return value is None
    inner: Any = getattr(value, "__wrapped__", value)
    code = inner.__code__
    is_written = code.co_filename == "<string>" and code.co_qualname.startswith("__create_fn__.")
    return is_written or code.co_filename == DATACLASSES


def _is_empty(cell: types.CellType) -> bool:
    """Return whether a closure's variable has no value yet."""
    try:
        cell.cell_contents  # noqa: B018 (asking for it is the test)
    except ValueError:
        return True
    return False


def _module_version(module: types.ModuleType | None) -> str:
    """Return the first name of a module, with the version of its package if that says one."""
    if module is None:
        return "unknown"
    name = first_name(module.__name__)
    package = sys.modules.get(name.partition(".")[0], module)
    return f"{name} {getattr(package, '__version__', '')}"
