"""One text of step() and terms() for every library: only the words that a lane binds are bound to each one's own."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType, ModuleType

from controllers.rollout.inline import WORDS


def rebind(function: Callable, words: dict[str, Callable]) -> FunctionType:
    """The same function with its words bound anew."""
    assert isinstance(function, FunctionType)
    return FunctionType(function.__code__, {**function.__globals__, **words})


def functions_of(library: ModuleType) -> dict[str, Callable]:
    """jax.numpy's, say."""
    return {word: getattr(library, word) for word in WORDS}


def torch_functions(torch: ModuleType) -> dict[str, Callable]:
    """PyTorch's, whose minimum and maximum know no plain numbers."""

    def of_tensors(choose: Callable) -> Callable:
        return lambda a, b: choose(torch.as_tensor(a), torch.as_tensor(b))

    return functions_of(torch) | {word: of_tensors(getattr(torch, word)) for word in ("minimum", "maximum")}
