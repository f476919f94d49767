"""Sweep the exponent of colored sampling, and plot thrust variation against lap time."""

import matplotlib.pyplot as plt

import quadsim

# Without a cut-off, gamma 0 is white noise; with one, the spectrum falls above it in any case.
white = {"sampler": "colored", "cutoff": None}
gammas = [(gamma,) * 4 for gamma in (0.0, 1.0, 2.0, 4.0)]
conditions = {"attempts": 4, "laps": 1, "samples": 512, "randomize": 1.0}
swept = quadsim.sweep("figure8", {"gamma": gammas}, {"colored": white}, **conditions)
print(swept)

figure, axes = plt.subplots()
laps = [point.stats.lap_mean for point in swept.points]  # [s]
variation = [point.stats.thrust_tv for point in swept.points]  # [m/s^2/s]
axes.plot(laps, variation, "o-")
for point, x, y in zip(swept.points, laps, variation, strict=True):
    gamma = point.value.split(":")[0]
    print(f"gamma {gamma}: lap {x:.3f} s, thrust variation {y:.0f} m/s^2/s")
    axes.annotate(f" gamma {gamma}", (x, y))
axes.set(xlabel="lap time [s]", ylabel="total variation of the thrust [m/s$^2$/s]")
figure.savefig("sweep_gamma.png")
