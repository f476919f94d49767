"""Figures of stored flights and races.

Beside this package, quadsim.paper draws the paper's figures with matplotlib, and quadsim.campaign
those of comparisons (`figure.py`, `heats_figure.py`).
"""
