"""The configuration of a sampler, and its source of perturbations z of v = u + z.

The memory layout, and chunks of samples, are described in quadsim.controllers.lanes.layout.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from msgspec import Meta

Sigma = tuple[Annotated[float, Meta(gt=0, le=1000)], ...]  # standard deviation of each control
Gamma = tuple[Annotated[float, Meta(ge=0, le=10)], ...]  # exponent of each control, PSD ~ 1/f^gamma
# of each control [Hz]; 0 or (): no cut-off
Cutoff = tuple[Annotated[float, Meta(ge=0, le=1e6)], ...]
Shift = Literal["corrected", "published"]


class Momentum:
    """The change D dt of the plan in the last iteration; see quadsim.controllers.samplers.smooth.

    Args:
        horizon: T, number of control periods.
        controls: n_u, number of controls.
        shift: method of the shift from one control period to the next.
    """

    def __init__(self, horizon: int, controls: int, shift: Shift):
        self.change = np.zeros((horizon, controls))  # (T, n_u)
        self._shift = shift

    def shift(self, steps: int) -> None:
        """Shift the change by a number of control periods; its last row is repeated at the end."""
        T = len(self.change)
        rows = np.minimum(np.arange(T) + steps, T - 1)
        if self._shift == "published":
            rows = np.full_like(rows, rows[0])
        self.change = self.change[rows]


@dataclass(frozen=True)
class LaneSampler:
    """A source of perturbations of the plan, or of plan + momentum if there is a momentum."""

    # sample(call, first=0, samples=as built) -> z (series, n_u, halves * T, LANES) of the samples
    # from `first` on, a multiple of 4 LANES. It is a function of (key, call, number of the sample)
    # alone. The next call writes to the same memory.
    sample: Callable[..., np.ndarray]
    # The compiled loop of the source, if any
    loop: Callable | None
    momentum: Momentum | None = None
    # Number of normals drawn for each perturbation
    normals: float = 1.0


@runtime_checkable
class Sampling(Protocol):
    """A frozen dataclass of a sampler's parameters: its configuration and public object."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def sigma(self) -> tuple[float, ...]:
        """The standard deviations, one for each control."""
        ...

    def build(
        self, samples: int, lengths: Sequence[int], key: np.ndarray, dt: float
    ) -> LaneSampler:
        """Return a source of perturbations.

        Args:
            samples: largest number of samples drawn at a time.
            lengths: number of control periods of each step of the rollouts  (T,). The perturbation
                of a longer step is the mean of its periods' perturbations, or varies as much.
            key: key of the random numbers  (2,) uint32.
            dt: control period [s].
        """
        ...


def white_shares(lengths: Sequence[int]) -> np.ndarray:
    """Return the standard deviation of white noise that is averaged over each step.

    That of the noise of one control period is 1.

    Args:
        lengths: number of control periods of each step  (T,).

    Returns:
        (T,)
    """
    return 1.0 / np.sqrt(lengths)


def stream_key(seed: int | np.random.SeedSequence) -> np.ndarray:
    """Return the key of the counter-based generator for a random stream.  (2,) uint32"""
    stream = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    return stream.generate_state(2, np.uint32)
