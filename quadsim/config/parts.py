"""The user's own objects in a flight: how they are checked, called and recorded.

They are a sampler, terms, a cost, a plant, a controller and a referee. A run stores their names,
the numbers that they hold and a hash that tells them from others, not their code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass
from functools import partial
from importlib import import_module
from inspect import Parameter, signature
from math import isfinite
from pathlib import Path
from types import FunctionType
from typing import Any, cast

import numpy as np

from quadsim.config.identity import IdentityError, error_text, identity_of, main_name
from quadsim.config.settings import SettingError
from quadsim.controllers.costs import Term, Weight, is_weight
from quadsim.controllers.samplers import SAMPLERS, PlainSampler, Sampling
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.firmware.process import FirmwareError

Json = Any  # a value that JSON can hold
Sampler = Sampling | PlainSampler
WANTED_TERMS = "expected terms=[(function, weight), ...] or quadsim.controllers.costs.Term objects"
WANTED_SAMPLER = "expected a sampler: an object with sample(rng, samples, horizon, controls)"
DEEPEST = 12  # levels of objects within each other that a run stores
LARGE = 1000  # a run stores only the shape of an array of more numbers than this
# role of the user's own object -> the method that it needs
METHODS = {"plant": "step", "controller": "control", "referee": "observe"}
# Kinds of parameters that take an argument by its place
BY_PLACE = (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)
# The errors that a user's own module may end in when it is imported.
UNIMPORTABLE = (Exception, SystemExit)


def check_part(role: str, part: object) -> None:
    """Check that the user's plant, controller or referee has the method that its role needs.

    Args:
        role: one of METHODS.
        part: an object with that method, or a maker, see `is_maker`.

    Raises:
        SettingError: the part is neither.
    """
    if not (is_maker(role, part) or _has_method(role, part)):
        wanted = f"expected an object with {METHODS[role]!r}, or a function that makes one"
        raise SettingError(role, f"{wanted}, got {shown_value(part)}")


ADVICE = {
    "controller": "; give a control law as an object with control(x), and a policy as"
    " quadsim.PolicyController(policy)"
}


def is_maker(role: str, part: object) -> bool:
    """Return whether a part is called to make the object of its role for a flight.

    A maker is a class, or anything else that can be called and lacks the method of the role: a
    function, a bound method, a functools.partial or an object with `__call__`.
    """
    return isinstance(part, type) or (callable(part) and not _has_method(role, part))


def made(role: str, part: Any, spec: object) -> Any:
    """Return the part itself, or the object that its maker makes for this flight.

    A maker is called with the Spec, unless it can be called without arguments and none of its
    parameters is named `spec`.

    Args:
        role: one of METHODS.
        part: the part, or its maker.
        spec: the Spec.

    Raises:
        SettingError: a maker returns an object without the method of its role.
    """
    if part is None or not is_maker(role, part):
        return part
    found: Any = _make(role, part, spec)
    # What was made may be a maker itself, such as a quadsim.PolicyController.
    if is_maker(role, found) and not isinstance(found, type):
        found = _make(role, found, spec)
    if isinstance(found, type) or not _has_method(role, found):
        wanted = f"expected {shown_value(part)} to return an object with {METHODS[role]!r}"
        raise SettingError(role, f"{wanted}, got {shown_value(found)}")
    return found


def _make(role: str, maker: Callable[..., object], spec: object) -> object:
    """Return what a maker makes for a flight. An error of its own lines says why it was called."""
    given = [spec] if _takes_spec(maker) else []
    try:
        return called(role, maker, "the Spec", *given)
    except (TypeError, AttributeError) as error:
        what = "a Spec" if given else "nothing"
        error.add_note(
            f"{role}: {shown_value(maker)} was called with {what}, to make an object with"
            f" {METHODS[role]!r}{ADVICE.get(role, '')}"
        )
        raise


def _takes_spec(maker: Callable[..., object]) -> bool:
    """Return whether a maker is called with the Spec, see `made`."""
    try:
        parameters = signature(maker).parameters.values()
    except (TypeError, ValueError):  # one of C
        return True
    return any(
        one.kind is one.VAR_POSITIONAL
        or one.name == "spec"
        or (one.kind in BY_PLACE and one.default is one.empty)
        for one in parameters
    )


def called(role: str, function: Callable[..., Any], name: str, *arguments: object) -> Any:
    """Return what the user's function returns for one argument, or for none.

    Args:
        role: the setting that the function was given for.
        function: the function.
        name: of the argument, for the error.
        arguments: the argument, if the function is called with one.

    Raises:
        SettingError: the function cannot be called with one argument of this type. What the user's
            own lines raise is not changed.
    """
    try:
        return function(*arguments)
    except TypeError as error:
        # An error of the call itself, or of a function of C, comes from no further line of Python.
        if error.__traceback__ is not None and error.__traceback__.tb_next is not None:
            raise
        wanted = f"expected a function of {name}, got {shown_value(function)}"
        raise SettingError(role, f"{wanted}: {error}") from None


def runs_own_code(roles: Iterable[str]) -> bool:
    """Return whether parts of the user's own are called in flight: any part but a course.

    Args:
        roles: the roles of a flight's own parts.
    """
    return any(role != "course" for role in roles)


def fault_in_flight(error: Exception, has_own_parts: bool) -> str | None:
    """Return the text of an error by which a flight has ended as crashed, on one line.

    Args:
        error: what the planner or a part of the user's own has raised in flight.
        has_own_parts: whether the flight has parts of the user's own, which may raise anything.

    Returns:
        The text; None for an error that says nothing of the flight: the firmware has ended, or the
        program has a fault.
    """
    if isinstance(error, FirmwareError):
        return None
    if isinstance(error, ValueError | FloatingPointError):
        return error_text(error)
    if not has_own_parts:
        return None
    text = error_text(error)
    name = type(error).__name__
    return text if text.startswith(f"{name}: ") else f"{name}: {text}"


def _has_method(role: str, part: object) -> bool:
    return callable(getattr(part, METHODS[role], None))


def terms_of(objects: object) -> tuple[Term, ...]:
    """Return the cost terms of a list of Term objects and pairs (function, weight).

    Raises:
        SettingError: the objects are anything else.
    """
    if not isinstance(objects, tuple | list):
        raise SettingError("terms", f"{WANTED_TERMS}, got {shown_value(objects)}")
    return tuple(_term(term) for term in objects)


def _term(given: object) -> Term:
    """Return one term. Raises SettingError."""
    if isinstance(given, Term):
        return given
    if not isinstance(given, tuple | list) or len(given) != 2 or not callable(given[0]):
        raise SettingError("terms", f"{WANTED_TERMS}, got {shown_value(given)}")
    function, weight = given
    if not is_weight(weight):
        wanted = f"{WANTED_TERMS} with a finite weight"
        problem = f"{wanted}, got {shown_value(weight)} for {shown_value(function)}"
        raise SettingError("terms", problem)
    return _named_term("terms", function, float(weight) if np.ndim(weight) == 0 else weight)


def _named_term(setting: str, function: Any, weight: Weight) -> Term:
    """Return a term of a function, which has a name. Raises SettingError."""
    try:
        return Term(function, weight)
    except ValueError as error:
        raise SettingError(setting, str(error)) from None


def term_of_text(text: str) -> Term:
    """Return the term that "package.module:function=WEIGHT" names. Raises SettingError."""
    place, has_weight, weight = text.rpartition("=")
    wanted = f"expected package.module:function=WEIGHT, got {text!r}"
    if not has_weight:
        raise SettingError("term", f"{wanted}: the weight is missing, as in {text}=1")
    try:
        function = _imported(place)
        number = float(weight)
    except UNIMPORTABLE as error:
        raise SettingError("term", f"{wanted}: {reason(error)}") from None
    if not callable(function) or not np.isfinite(number):
        raise SettingError("term", wanted)
    return _named_term("term", function, number)


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
    except UNIMPORTABLE as error:
        if isinstance(error, SettingError):
            raise
        wanted = f"expected package.module:Class without arguments, got {given!r}"
        raise SettingError("sampler", f"{wanted}: {reason(error)}") from None


def own_controller(given: object) -> Any:
    """Return a controller, or its maker, given as an object or as "package.module:Class".

    Raises:
        SettingError: there is no such controller.
    """
    if not isinstance(given, str):
        return given
    wanted = f"expected package.module:Class, got {given!r}"
    if ":" not in given:
        raise SettingError("controller", wanted)
    try:
        found = _imported(given)
    except UNIMPORTABLE as error:
        raise SettingError("controller", f"{wanted}: {reason(error)}") from None
    if isinstance(found, type) and not _has_method("controller", found):
        problem = f"the class has no method {METHODS['controller']!r}"
        raise SettingError("controller", f"{wanted}: {problem}")
    check_part("controller", found)
    return found


def reason(error: BaseException) -> str:
    """Return the text of an error on one line, with its type if that says more."""
    text = " ".join(str(error).split())
    if isinstance(error, ModuleNotFoundError):
        text += ", in this folder or the environment (PYTHONPATH)"
    is_plain = isinstance(error, ImportError | AttributeError | TypeError | ValueError)
    return text if is_plain and text else f"{type(error).__name__} {text}".rstrip()


def _imported(text: str) -> Any:
    """Return the object that "package.module:name" names."""
    module, _, name = text.partition(":")
    return getattr(import_module(module), name)


def _sampler(given: object) -> Sampler:
    """Return a sampler. Raises SettingError for any other object."""
    is_sampler = type(given) in SAMPLERS.values() or callable(getattr(given, "sample", None))
    if isinstance(given, type) or not is_sampler:
        raise SettingError("sampler", f"{WANTED_SAMPLER}, got {shown_value(given)}")
    return cast(Sampler, given)


def sampler_name(sampler: Sampler) -> str:
    """Return the name of a registered sampler, or the class name of the user's own."""
    for name, cls in SAMPLERS.items():
        if type(sampler) is cls:
            return name
    return type(sampler).__name__


def is_registered(sampler: Sampler) -> bool:
    """Return whether a sampler is one of SAMPLERS, not the user's own."""
    return type(sampler) in SAMPLERS.values()


def describe(part: object) -> dict[str, Json]:
    """Return {class, parameters, sha256} of one of the user's own objects.

    The hash comes from `identity_of`; it is None for an object without an identity.
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
    """Return the identity of an object, None if it has none."""
    try:
        return identity_of(part)
    except IdentityError:
        return None


def qualified_name(kind: Any) -> str:
    """Return the module and name of a class or function.

    A functools.partial has the names of its function, any other object the names of its class.
    """
    while isinstance(kind, partial):
        kind = kind.func
    if not hasattr(kind, "__qualname__"):
        kind = type(kind)
    return f"{main_name(kind.__module__)}.{kind.__qualname__}"


def _is_maker(part: object) -> bool:
    """Return whether a part is a class or a function, which is called with the Spec."""
    return isinstance(part, type | FunctionType)


def plain(value: object, depth: int = DEEPEST) -> Json:
    """Return a value as JSON can hold it: a large array as its shape, an object as its class.

    depth: levels of objects within each other that are shown.
    """
    if depth == 0:
        return "..."
    if isinstance(value, float) and not isfinite(value):
        return str(value)  # which JSON does not know
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, dict):
        return {str(k): plain(v, depth - 1) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v, depth - 1) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist()) if value.size <= LARGE else f"array {value.shape}"
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name), depth - 1) for f in fields(value)}
    return qualified_name(value if _is_maker(value) else type(value))
