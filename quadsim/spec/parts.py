"""The user's own objects in a flight: how they are checked, called and recorded.

They are a sampler, terms, a cost, a plant, a controller and a referee. A run stores their names,
the numbers that they hold and a hash that tells them from others, not their code.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from controllers.costs import Term
from controllers.samplers import SAMPLERS, PlainSampler, Sampling
from quadsim.course import Course, parse_course
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import did_you_mean
from quadsim.spec.identity import IdentityError, identity_of
from quadsim.spec.settings import SettingError

Json = Any  # a value that JSON can hold
Sampler = Sampling | PlainSampler
WANTED_TERMS = "expected terms=[(function, weight), ...] or controllers.costs.Term objects"
WANTED_SAMPLER = "expected a sampler: an object with sample(rng, samples, horizon, controls)"
LARGE = 1000  # a run stores only the shape of an array of more numbers than this
# role of the user's own object -> the method that it needs
METHODS = {"plant": "step", "controller": "control", "referee": "observe"}


def check_part(role: str, part: object) -> None:
    """Check that the user's plant, controller or referee has the method that its role needs.

    Args:
        role: one of METHODS.
        part: an object with that method, or a class or function that is called with the Spec.

    Raises:
        SettingError: the part is neither.
    """
    if not (callable(part) or hasattr(part, METHODS[role])):
        wanted = f"expected an object with {METHODS[role]!r}, or a function that makes one"
        raise SettingError(role, f"{wanted}, got {part!r}")


def made(part: Any, spec: object) -> Any:
    """Return the part itself, or the object that its class or function makes for this flight."""
    return part(spec) if _is_maker(part) else part


def terms_of(objects: object) -> tuple[Term, ...]:
    """Return the cost terms of a list of Term objects and pairs (function, weight).

    Raises:
        SettingError: the objects are anything else.
    """
    if not isinstance(objects, tuple | list):
        raise SettingError("terms", f"{WANTED_TERMS}, got {objects!r}")
    return tuple(_term(term) for term in objects)


def _term(given: object) -> Term:
    """Return one term. Raises SettingError."""
    if isinstance(given, Term):
        return given
    if not isinstance(given, tuple | list) or len(given) != 2 or not callable(given[0]):
        raise SettingError("terms", f"{WANTED_TERMS}, got {given!r}")
    function, weight = given
    is_number = isinstance(weight, int | float | np.ndarray) and not isinstance(weight, bool)
    if not is_number or not np.isfinite(weight).all():
        name = qualified_name(function)
        wanted = f"{WANTED_TERMS} with a finite weight"
        raise SettingError("terms", f"{wanted}, got {weight!r} for {name}")
    return Term(function, float(weight) if np.ndim(weight) == 0 else weight)


def term_of_text(text: str) -> Term:
    """Return the term that "package.module:function=WEIGHT" names. Raises SettingError."""
    place, _, weight = text.rpartition("=")
    wanted = f"expected package.module:function=WEIGHT, got {text!r}"
    try:
        function = _imported(place)
        number = float(weight)
    except (ImportError, AttributeError, ValueError) as error:
        raise SettingError("term", f"{wanted}: {error}") from None
    if not callable(function) or not np.isfinite(number):
        raise SettingError("term", wanted)
    return Term(function, number)


def own_sampler(given: object) -> Sampler | None:
    """Return a sampler given as an object or as "package.module:Class".

    Returns:
        The sampler, or None for the name of a registered one.

    Raises:
        SettingError: there is no such sampler.
    """
    if not isinstance(given, str):
        return _sampler(given)
    if given in SAMPLERS:
        return None
    if ":" not in given:
        raise SettingError("sampler", f"no sampler {given!r}: {did_you_mean(given, SAMPLERS)}")
    try:
        found = _imported(given)
        return _sampler(found() if isinstance(found, type) else found)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        if isinstance(error, SettingError):
            raise
        wanted = f"expected package.module:Class without arguments, got {given!r}"
        raise SettingError("sampler", f"{wanted}: {error}") from None


def _imported(text: str) -> Any:
    """Return the object that "package.module:name" names."""
    module, _, name = text.partition(":")
    return getattr(import_module(module), name)


def _sampler(given: object) -> Sampler:
    """Return a sampler. Raises SettingError for any other object."""
    if isinstance(given, type) or not isinstance(given, (PlainSampler, *SAMPLERS.values())):
        raise SettingError("sampler", f"{WANTED_SAMPLER}, got {given!r}")
    return given


def sampler_name(sampler: Sampler) -> str:
    """Return the name of a registered sampler, or the class name of the user's own."""
    for name, cls in SAMPLERS.items():
        if type(sampler) is cls:
            return name
    return type(sampler).__name__


def is_registered(sampler: Sampler) -> bool:
    """Return whether a sampler is one of SAMPLERS, not the user's own."""
    return type(sampler) in SAMPLERS.values()


def is_described(course: Course) -> bool:
    """Return whether a course is the one that its text describes."""
    try:
        return parse_course(course.text, course.name) == course
    except FileError:
        return False


def describe(part: object) -> dict[str, Json]:
    """Return {class, parameters, sha256} of one of the user's own objects.

    The hash is that of `identity_of`, None for an object without an identity.
    """
    kind = part if _is_maker(part) else type(part)
    values = {} if kind is part else getattr(part, "__dict__", {})
    parameters = {name: plain(value) for name, value in values.items()}
    return {
        "class": qualified_name(kind),
        "parameters": parameters,
        "sha256": _identity(part),
    }


def describe_term(term: Term) -> dict[str, Json]:
    """Return {name, function, weight, parameters, sha256} of a term."""
    record: Any = term.parameters
    values = record._asdict() if record else {}
    return {
        "name": term.name,
        "function": qualified_name(term.function),
        "weight": plain(term.weight),
        "parameters": plain(values),
        "sha256": _identity(term),
    }


def _identity(part: object) -> str | None:
    """Return the identity of an object, None where it has none."""
    try:
        return identity_of(part)
    except IdentityError:
        return None


def qualified_name(kind: Any) -> str:
    """Return the module and name of a class or function."""
    # A worker process has the script of its parent under another name
    module = "__main__" if kind.__module__ == "__mp_main__" else kind.__module__
    return f"{module}.{kind.__qualname__}"


def _is_maker(part: object) -> bool:
    """Return whether a part is a class or a function, which is called with the Spec."""
    return isinstance(part, type | FunctionType)


def plain(value: object) -> Json:
    """Return a value as JSON can hold it: a large array as its shape, an object as its class."""
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist() if value.size <= LARGE else f"array {value.shape}"
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    return qualified_name(value if _is_maker(value) else type(value))
