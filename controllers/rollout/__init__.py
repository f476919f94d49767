"""The compiled lanes: the only place that imports numba. See lanes.py for how a rollout is built."""

import os

# Waiting threads sleep. Where they spin (OpenMP's default) and other programs share the cores, each
# parallel loop waits for a time slice: measured 17 ms a loop in place of 0.1.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
