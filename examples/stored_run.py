"""Store a run, read it again and plot its speed."""

import matplotlib.pyplot as plt
import numpy as np

import quadsim

flown = quadsim.fly("figure8", laps=1, samples=1024)
folder = flown.save("runs")
run = quadsim.load_run(folder)
print(folder.name, run.outcome, "digest", run.digest()[:12])
speed = np.sqrt(sum(run.telemetry[name] ** 2 for name in ("vx", "vy", "vz")))
figure, axes = plt.subplots()
axes.plot(run.telemetry["t"], speed)
axes.set(xlabel="t [s]", ylabel="speed [m/s]")
figure.savefig("speed.png")
