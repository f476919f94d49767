"""Log-MPPI (Mohamed et al. 2022): noise that is the product of a normal and a log-normal.

The noise is white like Gaussian noise, but has heavier tails.

    z = sigma xi exp(sigma eta),  xi, eta ~ N(0, 1) independent for every sample, time and control

The standard deviation is sigma exp(sigma^2), the kurtosis 3 exp(4 sigma^2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from quadsim.controllers.lanes.layout import LANES, blocks
from quadsim.controllers.samplers.lane_sampler import LaneSampler, Sigma, white_shares
from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields

# Largest exponent: exp(60) is far beyond any control and far below float32's largest number
CEILING = np.float32(60.0)


@dataclass(frozen=True)
class LogNormal:
    """v = u + sigma xi exp(sigma eta), xi and eta ~ N(0, 1) independent; Mohamed et al. 2022.

    The parameter sigma (n_u,) has the units of the controls as the factor of xi, and no unit as the
    factor of eta. The standard deviation of the noise is sigma exp(sigma^2).

    Examples:
        >>> from quadsim import LogNormal
        >>> sampler = LogNormal(sigma=(0.28, 0.28, 0.28, 1.08))
    """

    sigma: Annotated[Sigma, setting("scale of both normals for each control, in its unit")]

    def __post_init__(self) -> None:
        check_fields(self)

    def build(
        self, samples: int, lengths: Sequence[int], key: np.ndarray, dt: float
    ) -> LaneSampler:
        """Return the source of perturbations, see Sampling."""
        # Imported here, as it loads the compiler
        from quadsim.controllers.lanes.normals import fill_normals, normal_blocks

        shape = (len(self.sigma), len(lengths), LANES)
        normals = np.empty((blocks(samples), 2, *shape), np.float32)  # sigma xi, sigma eta
        noise = np.empty((blocks(samples), *shape), np.float32)
        factors = np.stack([white_shares(lengths), np.ones(len(lengths))])
        of_controls = np.array(self.sigma)[None, :, None] * factors[:, None]  # (2, n_u, T)
        scale = of_controls.astype(np.float32).ravel()

        def sample(call: int, first: int = 0, samples: int = samples) -> np.ndarray:
            n = normals[: blocks(samples)]
            z = noise[: blocks(samples)]
            fill_normals(n.reshape(len(n), -1, LANES), scale, key, call, first // LANES)
            np.minimum(n[:, 1], CEILING, out=z)
            np.exp(z, out=z)
            return np.multiply(z, n[:, 0], out=z)

        return LaneSampler(sample, normal_blocks)
