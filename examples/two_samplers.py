"""Compare Gaussian and colored sampling on the same randomized seeds."""

import quadsim

comparison = quadsim.compare(
    "figure8", ("gaussian", "colored"), attempts=3, laps=1, samples=512, randomize=1.0
)
print(comparison)
(pair,) = comparison.pairs
print(f"colored - gaussian: {pair.lap_difference.mean:+.3f} s a lap")
