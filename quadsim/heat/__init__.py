"""Heats. A heat is a race of several vehicles in one world.

From the settings of the entrants (`settings`, `line_up`, `spec`) and where they start (`grid`) over
the loop that flies them (`launch`, `loop`, `marshal`, `rules`) and what they know of each other
(`traffic`, `expectations`, `aware_planner`) to the result and its folder (`result`, `archive`).
"""
