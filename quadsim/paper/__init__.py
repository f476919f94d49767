"""The paper's tables and figures, rerun: a module for each, with `make(runs, folder) -> Result`.

See docs/paper.md. The off-road vehicle and the double integrator live here too; each experiment
controls them in a short loop of its own.
"""
