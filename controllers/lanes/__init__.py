"""The compiled lanes: the only folder that imports numba, apart from the rasteriser.

A rollout takes the plain functions of a model and a cost through these files:

    trace.py          call them with symbols, record the operations as a graph
    text.py           write the graph as assignments
    planner_loops.py  put them into the loops over time and lanes
    compiled.py       compile that module, or load its code from the disk (code_cache.py)
    sharing.py        run a compiled loop on several threads, which helpers.py starts
    lanes.py          call the compiled loops: Rollout

environment.py does the same for learning environments, transform.py and passes.py for the Fourier
transforms of colored noise.
"""

# Differences allowed between compiled arithmetic and the source: fused multiply-add, reciprocals,
# either zero. Reassociation is not allowed: the compiler would then choose the order of a sum, and
# newly compiled and cached code have been observed to choose different orders.
FAST = {"contract", "arcp", "nsz"}
