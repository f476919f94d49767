"""The compiled lanes: the only place that imports numba. See lanes.py for how a rollout is built."""
