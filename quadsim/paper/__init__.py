"""Experiments for the paper's tables and figures: modules with `make(runs, folder) -> Result`.

See docs/paper.md. The models of the off-road vehicle and the double integrator are here too; each
experiment controls them in its own short loop.
"""
