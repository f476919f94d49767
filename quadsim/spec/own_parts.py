"""Parts of a flight that are objects of the user's own, and how a run describes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from importlib import import_module
from types import FunctionType
from typing import Any

import numpy as np

from controllers.costs import Cost, Term
from controllers.samplers import SAMPLERS, PlainSampler
from quadsim.files.yaml_words import did_you_mean
from quadsim.spec.settings import SettingError
from quadsim.spec.systems import SystemEntry

# what such an object has
OWN = {"cost": "terms", "plant": "step", "controller": "control", "referee": "observe"}
WANTED_TERMS = "expected terms=[(function, weight), ...] or controllers.costs.Term objects"
LARGE = 1000  # numbers of an array, which a run does not keep


@dataclass(frozen=True)
class OwnParts:
    """Objects of the user's own in place of named parts. A run keeps what they are called, not what
    they do.

    plant, controller, referee: an object for one flight, or a class or function that is called with
    the Spec.
    cost: a Cost, or a function of the default Cost that returns one.
    terms: Term objects, (function, weight) or, from the command line,
    "package.module:function=WEIGHT".
    """

    system: SystemEntry | None = None
    cost: Any = None
    terms: tuple[Term, ...] = ()  # beside those of the preset's cost
    plant: Any = None
    controller: Any = None
    referee: Any = None

    def described(self) -> dict[str, dict]:
        """{role: {class, parameters}} of those that are given, as JSON."""
        given = {
            f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("system", "terms")
        }
        described: dict[str, Any] = {
            role: describe(part) for role, part in given.items() if part is not None
        }
        if self.terms:
            described["terms"] = [describe_term(term) for term in self.terms]
        return described

    def with_terms(self, cost: Any) -> Cost:
        """Return the cost with the terms of the user's own after its own. Raises ValueError for a
        name it has."""
        return replace(cost, terms=(*cost.terms, *self.terms)) if self.terms else cost


def own_parts(given: dict[str, Any]) -> OwnParts:
    """The user's own among `given`, which are taken out of it. Raises SettingError."""
    parts = {
        role: given.pop(role) for role in OWN if role in given and not isinstance(given[role], str)
    }
    for role, part in parts.items():
        if not (part is None or callable(part) or hasattr(part, OWN[role])):
            wanted = f"expected an object with {OWN[role]!r}, or a function that makes one"
            raise SettingError(role, f"{wanted}, got {part!r}")
    objects = given.pop("terms", ())
    if not isinstance(objects, tuple | list):
        raise SettingError("terms", f"{WANTED_TERMS}, got {objects!r}")
    texts = _several(given.pop("term", ()))
    return OwnParts(**parts, terms=(*map(own_term, objects), *map(term_of_text, texts)))


def own_term(term: Any) -> Term:
    """Return a cost term that was given as a Term, or as a function and its weight. Raises
    SettingError."""
    if isinstance(term, Term):
        return term
    if not isinstance(term, tuple | list) or len(term) != 2 or not callable(term[0]):
        raise SettingError("terms", f"{WANTED_TERMS}, got {term!r}")
    function, weight = term
    if (
        isinstance(weight, bool)
        or not isinstance(weight, int | float | np.ndarray)
        or not np.isfinite(weight).all()
    ):
        raise SettingError(
            "terms", f"{WANTED_TERMS} with a finite weight, got {weight!r} for {_name(function)}"
        )
    return Term(function, float(weight) if np.ndim(weight) == 0 else weight)


def term_of_text(text: str) -> Term:
    """Return the term of "package.module:function=WEIGHT". Raises SettingError."""
    where, _, weight = text.rpartition("=")
    module, _, name = where.partition(":")
    wanted = f"expected package.module:function=WEIGHT, got {text!r}"
    try:
        function = getattr(import_module(module), name)
        number = float(weight)
    except (ImportError, AttributeError, ValueError) as error:
        raise SettingError("term", f"{wanted}: {error}") from None
    if not callable(function) or not np.isfinite(number):
        raise SettingError("term", wanted)
    return Term(function, number)


def _several(texts: Any) -> Sequence[str]:
    return (texts,) if isinstance(texts, str) else texts


def describe_term(term: Term) -> dict:
    """Return {name, function, weight, parameters} of a term, as JSON."""
    parameters: Any = term.parameters
    values = parameters._asdict() if parameters else {}
    return {
        "name": term.name,
        "function": _name(term.function),
        "weight": plain(term.weight),
        "parameters": plain(values),
    }


def sampler_object(sampler: Any) -> Any:
    """A sampler that was given as an object or as "package.module:Class"; None for the name of a
    registered one."""
    if not isinstance(sampler, str):
        return with_sample(sampler)
    if ":" not in sampler:
        if sampler not in SAMPLERS:
            raise SettingError(
                "sampler", f"no sampler {sampler!r}: {did_you_mean(sampler, SAMPLERS)}"
            )
        return None
    module, _, name = sampler.partition(":")
    try:
        found = getattr(import_module(module), name)
        return with_sample(found() if isinstance(found, type) else found)
    except (ImportError, AttributeError, TypeError) as error:
        wanted = f"expected package.module:Class without arguments, got {sampler!r}"
        raise SettingError("sampler", f"{wanted}: {error}") from None


def with_sample(sampler: Any) -> Any:
    """A sampler. Raises SettingError."""
    if isinstance(sampler, type) or not isinstance(sampler, (PlainSampler, *SAMPLERS.values())):
        wanted = "expected a sampler: an object with sample(rng, samples, horizon, controls)"
        raise SettingError("sampler", f"{wanted}, got {sampler!r}")
    return sampler


def sampler_name(sampler: Any) -> str:
    """As registered, or the class name of a user's own."""
    return next(
        (name for name, cls in SAMPLERS.items() if type(sampler) is cls), type(sampler).__name__
    )


def describe(part: Any) -> dict:
    """{class, parameters} of a user's object, as JSON."""
    kind = part if _is_maker(part) else type(part)
    values = {} if kind is part else getattr(part, "__dict__", {})
    return {"class": _name(kind), "parameters": {k: plain(v) for k, v in values.items()}}


def _name(kind: Any) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _is_maker(part: Any) -> bool:
    """A class or a function: called with the spec."""
    return isinstance(part, type | FunctionType)


def made(part: Any, spec: Any) -> Any:
    """The part itself, or what its class or function makes for this flight."""
    return part(spec) if _is_maker(part) else part


def plain(value: Any) -> Any:
    """As JSON holds it; of large arrays the shape, of other objects the class."""
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist() if value.size <= LARGE else f"array {value.shape}"
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in fields(value)}
    return _name(value if _is_maker(value) else type(value))
