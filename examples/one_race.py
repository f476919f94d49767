"""Fly one race and look at it."""

import quadsim

run = quadsim.fly("figure8", sampler="colored", seed=0, laps=1)
print(run.outcome, [f"{t:.3f} s" for t in run.laps])
quadsim.plot(run, "one_race.png")
