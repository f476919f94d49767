"""JSON is read into typed objects, and 60 stays apart from 60.0."""

import json
from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import pytest

from quadsim.files.exact_json import exactly


class Pair(NamedTuple):
    """Two numbers."""

    low: float
    high: float


@dataclass(frozen=True)
class Inner:
    """Numbers in lists and tuples."""

    pair: Pair
    sizes: tuple[float, ...] = ()


class Outer(msgspec.Struct):
    """Objects within each other, and a key with another name."""

    inner: list[Inner]
    before: float = msgspec.field(name="from", default=0.5)


def test_a_whole_number_stays_whole_and_a_float_a_float():
    text = '{"inner": [{"pair": [1, 2.0], "sizes": [3, 4.0, 5.5]}], "from": 60}'
    read = exactly(json.loads(text), Outer)
    assert json.loads(msgspec.json.encode(read)) == json.loads(text)
    assert repr(read.inner[0]) == "Inner(pair=Pair(low=1, high=2.0), sizes=(3, 4.0, 5.5))"
    assert repr(read.before) == "60"


def test_what_the_json_leaves_out_has_its_default():
    assert exactly({"inner": []}, Outer).before == 0.5


def test_another_type_is_refused():
    with pytest.raises(msgspec.ValidationError, match="Expected `float`, got `str`"):
        exactly({"inner": [], "from": "60"}, Outer)
