"""Two objects have the same identity only where they compute alike."""

import functools
import importlib.util
import subprocess
import sys
import threading
import types
from copy import deepcopy
from dataclasses import dataclass, field, make_dataclass, replace
from functools import cached_property

import numba
import numpy as np
import pytest

from quadsim.config.identity import IdentityError, identity_of
from quadsim.controllers.costs.race import RaceWeights
from quadsim.files.json_values import qualified_name


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


@dataclass(frozen=True)
class Record:
    """A record with a property that is computed once."""

    numbers: tuple = (1.0, 2.0)
    table: dict = field(default_factory=dict)

    @cached_property
    def total(self):
        return sum(self.numbers)


def scaled(k, power=2):
    """Return a function of a closure."""

    def inner(x):
        return k * x**power

    return inner


def with_default(k):
    """Return a function whose default is the number."""
    return lambda x, k=k: k * x


def matrix(**changed):
    """Return a large matrix with one number changed."""
    found = np.zeros((150, 150))
    found[70, 80] = changed.get("number", 0.0)
    return found.astype(changed.get("dtype", float))


def compiled_from(source, name="f"):
    """Return a function of a source text."""
    names = {"__name__": __name__}
    exec(compile(source, "<own>", "exec"), names)
    return names[name]


class Wrapping:
    """An object that names the function it stands for, as functools.wraps does."""

    def __init__(self, number):
        functools.update_wrapper(self, scaled)
        self.number = number


def module_of(source, name):
    """Return a module of the user's own, with this text."""
    module = types.ModuleType(name)
    exec(compile(source, f"<{name}>", "exec"), module.__dict__)
    return module


def importing(gain):
    """Return a function that imports one of the user's modules when it is called."""
    name = f"own_gain_{gain}"
    sys.modules[name] = module_of(f"K = {gain}\ndef gain(x):\n    return K * x", name)
    return compiled_from(f"def f(x):\n    from {name} import gain\n    return gain(x)")


def among_peers():
    """Return one of four objects that hold each other in sets."""
    nodes = [Held(set()) for _ in range(4)]
    for node in nodes:
        node.held |= {other for other in nodes if other is not node}
    return nodes[0]


def of_meta(number):
    """Return an object of a class whose metaclass has a number."""
    return type(f"Meta{number}", (type,), {"number": number})("Own", (), {})()


def named_like_numpy(factor):
    """Return a function of the user's that has the name of one of NumPy's."""

    @functools.wraps(np.sum)
    def total(x):
        return factor * np.sum(x)

    return total


def executed(text, name="A"):
    """Return an object that a text without a module's name has made, as `exec(code, {})` does."""
    made: dict = {}
    exec(text, made)
    return made[name]


def from_a_file(folder, name, text):
    """Return a module of the user's own that lies in a file."""
    file = folder / f"{name}.py"
    file.write_text(text)
    spec = importlib.util.spec_from_file_location(name, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


DIFFERENT = {
    "a function with the name of NumPy's": (named_like_numpy(1.0), named_like_numpy(2.0)),
    "an edited function with the name of NumPy's": (
        functools.wraps(np.sum)(compiled_from("def f(x):\n    return x + 1")),
        functools.wraps(np.sum)(compiled_from("def f(x):\n    return x + 2")),
    ),
    "a class with the name of NumPy's": (
        functools.wraps(np.random.Generator, updated=())(
            compiled_from("class A:\n    def sample(self): return 1", "A")
        ),
        functools.wraps(np.random.Generator, updated=())(
            compiled_from("class A:\n    def sample(self): return 2", "A")
        ),
    ),
    "a class from exec": (
        executed("class A:\n    k = 1\n    def sample(self): return 1")(),
        executed("class A:\n    k = 2\n    def sample(self): return 1")(),
    ),
    "a record's own method from exec": (
        executed(
            "import dataclasses\n@dataclasses.dataclass(init=False)\nclass A:\n"
            "    def __init__(self): self.sample = lambda: 1"
        ),
        executed(
            "import dataclasses\n@dataclasses.dataclass(init=False)\nclass A:\n"
            "    def __init__(self): self.sample = lambda: 2"
        ),
    ),
    "one number of a large matrix": (Held(matrix()), Held(matrix(number=1e-9))),
    "the type of a matrix": (Held(matrix()), Held(matrix(dtype=np.float32))),
    "a closure's number": (scaled(1.0), scaled(1.5)),
    "a held closure": (Held(scaled(1.0)), Held(scaled(1.5))),
    "a default": (with_default(1.0), with_default(2.0)),
    "a lambda": (lambda x: x + 1, lambda x: x + 2),
    "a slot": (Slotted(1, 2), Slotted(2, 2)),
    "a private slot": (Slotted(1, 2), Slotted(1, 3)),
    "a field": (Record(), Record((1.0, 2.5))),
    "a mapping's value": (Record(table={"a": 1}), Record(table={"a": 2})),
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
    "a metaclass": (of_meta(1), of_meta(2)),
    "a ufunc's code and no code": (np.sin, np.cos),
    "options of the compiler": (numba.njit(scaled), numba.njit(fastmath=True)(scaled)),
    "the size of a cache": (functools.lru_cache(1)(scaled), functools.lru_cache(2)(scaled)),
    "the order of a mapping": (Held({"a": 1, "b": 2}), Held({"b": 2, "a": 1})),
    "defaults of a made record": (
        make_dataclass("Made", [("k", float, 1.0)]),
        make_dataclass("Made", [("k", float, 2.0)]),
    ),
    "an edited body": (
        compiled_from("def f(x):\n    return x + 1"),
        compiled_from("def f(x):\n    return x - 1"),
    ),
    "an edited method": (
        compiled_from("class A:\n    def sample(self): return 1", "A")(),
        compiled_from("class A:\n    def sample(self): return 2", "A")(),
    ),
    "an edited helper": (
        compiled_from("def g(x):\n    return x\ndef f(x):\n    return g(x)"),
        compiled_from("def g(x):\n    return 2 * x\ndef f(x):\n    return g(x)"),
    ),
    "an edited global": (
        compiled_from("K = 3.0\ndef f(x):\n    return K * x"),
        compiled_from("K = 4.0\ndef f(x):\n    return K * x"),
    ),
    "an edited base": (
        compiled_from("class B:\n    k = 1\nclass A(B):\n    pass", "A"),
        compiled_from("class B:\n    k = 2\nclass A(B):\n    pass", "A"),
    ),
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
            imports = compiled_from(f"def f():\n    import {name}\n    return {name}.GAIN")
            found[-1] += (identity_of(imports),)
    one, other = found
    assert not set(one) & set(other)


ALIKE = {
    "equal matrices": lambda: Held(matrix()),
    "closures of one function": lambda: scaled(1.5),
    "slots": lambda: Slotted([1, 2], {"a"}),
    "records": Record,
    "sets": lambda: Held({"one", "two", ("three", 4)}),
    "a function that calls itself": lambda: compiled_from("def f(x):\n    return f(x - 1)"),
}


@pytest.mark.parametrize("what", ALIKE)
def test_objects_that_are_alike_have_one_identity(what):
    assert identity_of(ALIKE[what]()) == identity_of(ALIKE[what]())


def test_a_name_a_comment_and_a_place_do_not_count():
    one = compiled_from("def f(x):\n    return x + 1")
    other = compiled_from("# a remark\n\n\ndef f(x):\n    # more\n    return x + 1")
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


def within_itself():
    held = Held(None)
    held.held = [held]
    return held


def nested(depth):
    held = Held(None)
    for _ in range(depth):
        held = Held(held)
    return held


UNTELLABLE = {
    "a lock": (Held(threading.Lock()), "its state is unknown: cannot pickle '_thread.lock'"),
    "a generator": (Held(k for k in range(3)), "cannot pickle 'generator' object"),
    "a memory": (Held(memoryview(b"")), "cannot pickle memoryview"),
    "a list of numba's": (Held(numba.typed.List([1.0])), "a List of numba is no function"),
    "a ufunc of Python": (Held(np.frompyfunc(lambda x: x, 1, 1)), "the code of the ufunc"),
    "an object within itself": (within_itself(), "expected an object that does not contain itself"),
    "objects that hold each other": (among_peers(), "expected an object that does not contain"),
    "a long chain": (nested(3000), "is not deeply nested"),
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
