"""Calls of `quadsim.fly` that a type checker accepts or refuses; `make lint` checks them.

A line that pyright must refuse carries an ignore. Where pyright no longer refuses it, the ignore is
reported as unnecessary, which fails the lint.
"""

# pyright: strict, reportUnnecessaryTypeIgnoreComment=true

import numpy as np

import quadsim
from quadsim import Colored, Spec, fly

fly("split_s_swift", sampler="gaussian", seed=3, horizon=120, sigma=(1, 1, 1, 4), laps=1)
fly(sampler=Colored((1.0,) * 4, (1.0,) * 4), sigma=np.ones(4), model_drag=0.0)
fly(Spec.of("figure8", vehicle="swift"), seed=7)
Spec.of(laps=2).but(sampler="colored", laps=None)
quadsim.frames("figure8", plant="rigid")

fly("split_s_swift", lapz=1)  # pyright: ignore[reportCallIssue]
fly(laps="one")  # pyright: ignore[reportArgumentType]
fly(plant="bulet")  # pyright: ignore[reportArgumentType]
Spec.of(seeed=1)  # pyright: ignore[reportCallIssue]
Spec.of().but(lapz=1)  # pyright: ignore[reportCallIssue]
