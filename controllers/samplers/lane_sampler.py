"""What a sampler is configured by and what it builds: perturbations z of v = u + z, in lanes of
samples.

Memory layout and chunks of samples: see controllers.lanes.layout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from msgspec import Meta

Sigma = tuple[Annotated[float, Meta(gt=0, le=1000)], ...]  # standard deviation of each control
Gamma = tuple[Annotated[float, Meta(ge=0, le=10)], ...]  # exponent of each control, PSD ~ 1/f^gamma
Shift = Literal["corrected", "published"]


class Momentum:
    """D dt, what the last iteration changed the plan by; see controllers.samplers.smooth.  `change`
    (T, n_u)"""

    def __init__(self, horizon: int, controls: int, shift: Shift):
        self.change = np.zeros((horizon, controls))
        self._shift = shift

    def shift(self, steps: int) -> None:
        """Time has moved on by so many control periods; beyond the horizon the last change goes
        on."""
        moved = np.minimum(np.arange(len(self.change)) + steps, len(self.change) - 1)
        self.change = self.change[
            moved if self._shift == "corrected" else np.full_like(moved, moved[0])
        ]


@dataclass(frozen=True)
class LaneSampler:
    """What MPPI draws from: perturbations of its plan, or of its plan and the momentum that this
    has.

    sample(call, first=0, samples=as built) -> z (series, n_u, halves * T, LANES) of the samples
    from `first` on, a multiple of 4 LANES: a function of (key, call, number of the sample) alone.
    The next call writes to the same memory.
    """

    sample: Callable[..., np.ndarray]
    loop: Callable | None  # the compiled one behind it, if any
    momentum: Momentum | None = None


@runtime_checkable
class Sampling(Protocol):
    """A frozen dataclass of a sampler's numbers, one sigma per control: configuration and public
    object."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def sigma(self) -> tuple[float, ...]: ...

    def build(self, samples: int, horizon: int, key: np.ndarray, dt: float) -> LaneSampler:
        """The source of at most so many samples at a time; key (2,) uint32, dt the control period
        [s]."""
        ...


def stream_key(seed: int | np.random.SeedSequence) -> np.ndarray:
    """The key of the counter-based generator for this random stream.  (2,) uint32"""
    stream = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
    return stream.generate_state(2, np.uint32)
