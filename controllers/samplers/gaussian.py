"""White Gaussian sampling: z_t ~ N(0, sigma^2), independent over t (Williams et al. 2018)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from quadsim.controllers.lanes.layout import LANES, blocks
from quadsim.controllers.samplers.lane_sampler import LaneSampler, Sigma, white_shares
from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields


@dataclass(frozen=True)
class Gaussian:
    """v = u + sigma xi, xi ~ N(0, 1) independent at every time step; Williams et al. 2018.

    Examples:
        >>> from quadsim import Gaussian
        >>> sampler = Gaussian(sigma=(0.3, 0.3, 0.3, 3.5))  # [rad/s, rad/s, rad/s, m/s^2]
    """

    sigma: Annotated[Sigma, setting("standard deviation of each control, in its unit")]

    def __post_init__(self) -> None:
        check_fields(self)

    def build(
        self, samples: int, lengths: Sequence[int], key: np.ndarray, dt: float
    ) -> LaneSampler:
        """Return the source of perturbations, see Sampling."""
        # Imported here, as it loads the compiler
        from quadsim.controllers.lanes.normals import fill_normals, normal_blocks

        noise = np.empty((blocks(samples), len(self.sigma), len(lengths), LANES), np.float32)
        scale = np.outer(self.sigma, white_shares(lengths)).astype(np.float32).ravel()  # (n_u * T,)

        def sample(call: int, first: int = 0, samples: int = samples) -> np.ndarray:
            z = noise[: blocks(samples)]
            fill_normals(z.reshape(len(z), -1, LANES), scale, key, call, first // LANES)
            return z

        return LaneSampler(sample, normal_blocks)
