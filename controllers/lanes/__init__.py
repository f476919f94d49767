"""The compiled lanes: the only place that imports numba. See lanes.py for how a rollout is
built."""

import os

# Waiting threads spin for about a tenth of a millisecond, then sleep: longer than the gap between
# two loops of a control step, and short enough for shared cores. Where they spin without end
# (OpenMP's default) and other programs run, each parallel loop waits for a time slice: measured 17
# ms a loop in place of 0.1.
os.environ.setdefault("GOMP_SPINCOUNT", "30000")

# How far compiled arithmetic may differ from what is written: fused multiply-add, reciprocals,
# either zero. Not reassociation: the order of a sum would then be the compiler's, and code just
# compiled and the same code from the cache have been seen to choose differently.
FAST = {"contract", "arcp", "nsz"}
