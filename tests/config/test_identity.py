"""Two objects have the same identity only if they compute alike."""

import enum
import functools
import importlib.util
import subprocess
import sys
import threading
import types
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numba
import numpy as np
import pytest

from quadsim.config.identity import IdentityError, identity_of
from quadsim.controllers.costs.race import RaceWeights
from quadsim.files.plain_values import qualified_name


class Held:
    """An object that holds anything."""

    def __init__(self, held):
        self.held = held

    def sample(self, rng, samples, horizon, controls):
        return self.held


class Slotted:
    """An object without a dictionary, one of whose slots is private."""

    __slots__ = ("__hidden", "shown")

    def __init__(self, shown, hidden):
        self.shown = shown
        self.__hidden = hidden


class Numbers(list):
    """A list with a name."""

    def __init__(self, numbers, name=""):
        super().__init__(numbers)
        self.name = name


class Kind(enum.Enum):
    ONE = 1
    OTHER = 2


@dataclass(frozen=True)
class Record:
    """A record with a property that is computed once."""

    numbers: tuple = (1.0, 2.0)
    table: dict = field(default_factory=dict)

    @cached_property
    def total(self):
        return sum(self.numbers)


class Wrapping:
    """An object that names the function it stands for, as functools.wraps does."""

    def __init__(self, number):
        functools.update_wrapper(self, scaled)
        self.number = number


def scaled(k, power=2):
    """Return a function of a closure."""

    def inner(x):
        return k * x**power

    return inner


def matrix(number=0.0, dtype=float):
    """Return a large matrix with this number within."""
    found = np.zeros((150, 150))
    found[70, 80] = number
    return found.astype(dtype)


def executed(text, number=1, name="f", **names):
    """Return what a text names `f` that has this number in place of NUMBER."""
    exec(compile(text.replace("NUMBER", str(number)), "<own>", "exec"), names)
    return names[name]


def module_of(text, name):
    """Return a module of the user's own, with this text."""
    module = types.ModuleType(name)
    exec(compile(text, f"<{name}>", "exec"), module.__dict__)
    return module


def importing(gain):
    """Return a function that imports one of the user's modules when it is called."""
    name = f"own_gain_{gain}"
    sys.modules[name] = module_of(f"K = {gain}\ndef gain(x):\n    return K * x", name)
    return executed(f"def f(x):\n    from {name} import gain\n    return gain(x)")


def from_a_file(folder, name, text):
    """Return a module of the user's own that lies in a file."""
    file = folder / f"{name}.py"
    file.write_text(text)
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


EDITED = {  # what is edited -> text of a program with a number, which makes `f`
    "a body": "def f(x):\n    return x + NUMBER",
    "a lambda": "f = lambda x: x + NUMBER",
    "a default": "f = lambda x, k=NUMBER: k * x",
    "a keyword's default": "f = lambda x, *, k=NUMBER: k * x",
    "a closure's number": "def of(k):\n    return lambda x: k * x\nf = of(NUMBER)",
    "a helper": "def g(x):\n    return NUMBER * x\ndef f(x):\n    return g(x)",
    "a global": "K = NUMBER\ndef f(x):\n    return K * x",
    "a method": "class A:\n    def sample(self): return NUMBER\nf = A()",
    "a static method": "class A:\n    @staticmethod\n    def sample(): return NUMBER\nf = A()",
    "a property": "class A:\n    @property\n    def k(self): return NUMBER\nf = A()",
    "an attribute of a class": "class A:\n    k = NUMBER\nf = A()",
    "a base": "class B:\n    k = NUMBER\nclass A(B):\n    pass\nf = A",
    "a metaclass": "f = type('Meta', (type,), {'k': NUMBER})('Own', (), {})()",
    "a function with the name of NumPy's": (
        "import functools, numpy\n@functools.wraps(numpy.sum)\ndef f(x):\n    return x + NUMBER"
    ),
    "the closure of a function with the name of NumPy's": (
        "import functools, numpy\ndef of(k):\n    @functools.wraps(numpy.sum)\n"
        "    def total(x):\n        return k * x\n    return total\nf = of(NUMBER)"
    ),
    "a class with the name of NumPy's": (
        "import functools, numpy\nclass A:\n    def sample(self): return NUMBER\n"
        "f = functools.wraps(numpy.random.Generator, updated=())(A)"
    ),
    "the default of a record that was made": (
        "import dataclasses\nf = dataclasses.make_dataclass('Made', [('k', float, NUMBER)])"
    ),
    "a sampler that is a PlainSampler": (
        "from quadsim.controllers.samplers.plain import PlainSampler\n"
        "class A(PlainSampler):\n    def sample(self, rng, *shape): return NUMBER\nf = A()"
    ),
    "a sampler that is a Sampling": (
        "from quadsim.controllers.samplers import Sampling\n"
        "class A(Sampling):\n    def build(self, *shape): return NUMBER\nf = A()"
    ),
    "a controller that is a Controller": (
        "from quadsim.racing.flight import Controller\n"
        "class A(Controller):\n    def control(self, x): return NUMBER\nf = A()"
    ),
    "a plant that is a Plant": (
        "from quadsim.physics.plant import Plant\n"
        "class A(Plant):\n    def step(self, u): return NUMBER\nf = A()"
    ),
    "a class of an own protocol": (
        "from typing import Protocol\nclass P(Protocol):\n    def sample(self): ...\n"
        "class A(P):\n    def sample(self): return NUMBER\nf = A()"
    ),
    "a class of a generic protocol": (
        "from typing import Protocol, TypeVar\nT = TypeVar('T')\n"
        "class P(Protocol[T]):\n    def sample(self) -> T: ...\n"
        "class A(P[int]):\n    def sample(self): return NUMBER\nf = A()"
    ),
    "a mixin beside a protocol": (
        "from typing import Protocol\nclass P(Protocol):\n    def sample(self): ...\n"
        "class M:\n    k = NUMBER\nclass A(M, P):\n    def sample(self): return self.k\nf = A()"
    ),
    "a class of a protocol that a part holds": (
        "from typing import Protocol\nclass P(Protocol):\n    def sample(self): ...\n"
        "class A(P):\n    def sample(self): return NUMBER\n"
        "class Part:\n    def __init__(self): self.kind = A\nf = Part()"
    ),
    "a global that is read by globals()": "K = NUMBER\ndef f(x):\n    return globals()['K'] * x",
    "a global within a text": "K = NUMBER\ndef f(x):\n    return eval('K * x')",
    "a list that tells less when it is pickled": (
        "class A(list):\n    def __reduce_ex__(self, protocol): return (list, ())\nf = A([NUMBER])"
    ),
    "an array that tells less when it is pickled": (
        "import numpy\nclass A(numpy.ndarray):\n"
        "    def __reduce_ex__(self, protocol): return (list, ())\n"
        "f = numpy.array([NUMBER]).view(A)"
    ),
    "the metadata of a field": (
        "import dataclasses\n@dataclasses.dataclass\nclass A:\n"
        "    k: float = dataclasses.field(default=1.0, metadata={'gain': NUMBER})\nf = A()"
    ),
    "a record's own method": (
        "import dataclasses\n@dataclasses.dataclass(init=False)\nclass A:\n"
        "    def __init__(self): self.sample = lambda: NUMBER\nf = A"
    ),
}


@pytest.mark.parametrize("what", EDITED)
def test_an_edited_program_makes_another_part(what):
    # With a module's name, and without one, as `exec(code, {})` has it
    for names in ({"__name__": __name__}, {}):
        one, same, other = (executed(EDITED[what], k, **names) for k in (1, 1, 2))
        assert identity_of(one) == identity_of(same)
        assert identity_of(one) != identity_of(other)


DIFFERENT = {
    "one number of a large matrix": (Held(matrix()), Held(matrix(1e-9))),
    "the type of a matrix": (Held(matrix()), Held(matrix(dtype=np.float32))),
    "a held closure": (Held(scaled(1.0)), Held(scaled(1.5))),
    "a slot": (Slotted(1, 2), Slotted(2, 2)),
    "a private slot": (Slotted(1, 2), Slotted(1, 3)),
    "a field": (Record(), Record((1.0, 2.5))),
    "a mapping's value": (Record(table={"a": 1}), Record(table={"a": 2})),
    "the order of a mapping": (Held({"a": 1, "b": 2}), Held({"b": 2, "a": 1})),
    "an item of a list of one's own": (Numbers([1, 2]), Numbers([1, 3])),
    "an attribute of a list of one's own": (Numbers([1, 2], "a"), Numbers([1, 2], "b")),
    "a member of an enumeration": (Kind.ONE, Kind.OTHER),
    "a bound method": (Held(1).sample, Held(2).sample),
    "a partial's argument": (functools.partial(scaled, 1), functools.partial(scaled, 2)),
    "a library's object": (RaceWeights(), replace(RaceWeights(), progress=1.5)),
    "a random generator": (np.random.default_rng(1), np.random.default_rng(2)),
    "whole and real": (Held(1), Held(1.0)),
    "the sign of zero": (Held(0.0), Held(-0.0)),
    "list and tuple": (Held([1]), Held((1,))),
    "a wrapping object's number": (Wrapping(1), Wrapping(2)),
    "a module in an attribute": (
        Held(module_of("K = 1", "own_module")),
        Held(module_of("K = 2", "own_module")),
    ),
    "a module that is imported in a function": (importing(2), importing(3)),
    "a ufunc": (np.sin, np.cos),
    "options of the compiler": (numba.njit(scaled), numba.njit(fastmath=True)(scaled)),
    "the size of a cache": (functools.lru_cache(1)(scaled), functools.lru_cache(2)(scaled)),
}


@pytest.mark.parametrize("what", DIFFERENT)
def test_objects_that_differ_have_different_identities(what):
    one, other = DIFFERENT[what]
    assert identity_of(one) == identity_of(one)
    assert identity_of(one) != identity_of(other)


@pytest.mark.parametrize("name", ["web", "queue", "quadsim"])
def test_a_module_of_ones_own_may_have_the_name_of_a_library(name, tmp_path, monkeypatch):
    # The second text has the size and the second of the first, so Python would take its bytecode.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    found = []
    for gain in (1, 2):
        text = f"GAIN = {gain}\nclass Mine:\n    def sample(self): return GAIN"
        module = from_a_file(tmp_path, name, text)
        found.append((identity_of(Held(module)), identity_of(module.Mine())))
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, name, module)
            assert identity_of(module.Mine()) == found[-1][1]
            imports = executed(f"def f():\n    import {name}\n    return {name}.GAIN")
            found[-1] += (identity_of(imports),)
    one, other = found
    assert not set(one) & set(other)


ALIKE = {
    "equal matrices": lambda: Held(matrix()),
    "closures of one function": lambda: scaled(1.5),
    "slots": lambda: Slotted([1, 2], {"a"}),
    "records": Record,
    "sets": lambda: Held({"one", "two", ("three", 4)}),
    "a function that calls itself": lambda: executed("def f(x):\n    return f(x - 1)"),
    "a class that calls its base": lambda: executed(
        "class A(list):\n    def __init__(self): super().__init__([A, type(self)])\nf = A"
    ),
}


@pytest.mark.parametrize("what", ALIKE)
def test_objects_that_are_alike_have_one_identity(what):
    assert identity_of(ALIKE[what]()) == identity_of(ALIKE[what]())


def test_one_object_that_is_held_twice_counts_as_two_equal_objects():
    """A worker gets copies: it may have two objects where the script has one."""
    shared = (1.0, "one")
    assert identity_of([shared, shared]) == identity_of([shared, deepcopy(shared)])
    held = Held(1.0)
    assert identity_of([held, held]) == identity_of([held, Held(1.0)])


def test_a_name_a_comment_and_a_place_do_not_count():
    one = executed("def f(x):\n    return x + 1")
    other = executed("# a remark\n\n\ndef f(x):\n    # more\n    return x + 1")
    assert identity_of(one) == identity_of(other)


def test_a_property_that_was_computed_does_not_count():
    record = Record()
    before = identity_of(record)
    assert record.total == 3.0
    assert identity_of(record) == before


def test_a_copy_has_the_same_identity_and_leaves_that_of_the_original():
    held = Held([matrix(), scaled(2.0), {"one", "two"}])
    before = identity_of(held)
    copy = deepcopy(held)
    assert identity_of(held) == before
    assert identity_of(copy) == before


def within_itself(hold):
    """Return an object that is within what it holds."""
    held = Held(None)
    held.held = hold(held)
    return held


def nested(depth):
    held = Held(None)
    for _ in range(depth):
        held = Held(held)
    return held


WITHIN = "expected an object that does not contain itself and is not deeply nested"
UNTELLABLE = {
    "a lock": (Held(threading.Lock()), "its state is unknown: cannot pickle '_thread.lock'"),
    "a generator": (Held(k for k in range(3)), "cannot pickle 'generator' object"),
    "a memory": (Held(memoryview(b"")), "cannot pickle memoryview"),
    "a list of numba's": (Held(numba.typed.List([1.0])), "a List of numba is no function"),
    "a ufunc of Python": (Held(np.frompyfunc(lambda x: x, 1, 1)), "the code of the ufunc"),
    "an object within its attribute": (within_itself(lambda held: held), WITHIN),
    "an object within its list": (within_itself(lambda held: [held]), WITHIN),
    "an object within its set": (within_itself(lambda held: {Held(held)}), WITHIN),
    "a long chain": (nested(30_000), WITHIN),
}


@pytest.mark.parametrize("what", UNTELLABLE)
def test_an_object_that_cannot_be_told_from_others_has_no_identity(what):
    part, problem = UNTELLABLE[what]
    with pytest.raises(IdentityError, match=f"^Held: .*{problem}") as error:
        identity_of(part)
    assert "\n" not in str(error.value)


PROCESS = """
import numpy as np
from quadsim.config.identity import identity_of
class Mine:
    words = {"some", "words", "in", "a", "set"}
    def __init__(self): self.table = {w: np.arange(3) for w in sorted(self.words)}
    def sample(self, n): return np.zeros(n) + len(self.words)
print(identity_of(Mine()))
"""


@pytest.mark.process
def test_an_identity_is_the_same_in_every_process():
    def found(hash_seed):
        env = {"PYTHONHASHSEED": hash_seed, "PATH": "", "PYTHONPATH": ":".join(sys.path)}
        command = [sys.executable, "-c", PROCESS]
        return subprocess.run(command, env=env, capture_output=True, text=True, check=True).stdout

    first = found("1")
    assert len(first.strip()) == 64
    assert found("2") == first


def test_a_script_has_one_name_in_every_process(monkeypatch):
    monkeypatch.setattr(Held, "__module__", "__mp_main__")
    assert qualified_name(Held) == "__main__.Held"
