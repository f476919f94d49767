"""Sweep the exponent of colored sampling, and plot thrust chatter against lap time."""

import matplotlib.pyplot as plt

import quadsim
from quadsim.report.metrics import chatter

gammas = (0.0, 0.5, 1.0, 2.0, 4.0)
laps = []  # [s]
variation = []  # [m/s^2/s]
for gamma in gammas:
    run = quadsim.fly("figure8", laps=1, gamma=(gamma,) * 4, samples=512)
    laps.append(run.laps[0] if run.laps else float("nan"))
    variation.append(chatter(run)["commanded"]["thrust_tv"])
    print(f"gamma {gamma:g}: lap {laps[-1]:.3f} s, thrust variation {variation[-1]:.0f} m/s^2/s")
figure, axes = plt.subplots()
axes.plot(laps, variation, "o-")
for gamma, x, y in zip(gammas, laps, variation, strict=True):
    axes.annotate(f" gamma {gamma:g}", (x, y))
axes.set(xlabel="lap time [s]", ylabel="total variation of the thrust [m/s$^2$/s]")
figure.savefig("sweep_gamma.png")
