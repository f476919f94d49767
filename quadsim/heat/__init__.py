"""Heats. A heat is a race of several vehicles in one world.

`settings`, `line_up` and `spec` say who races and how, and `grid` places the starts. `launch` and
`loop` fly the heat, and `marshal` and `rules` judge it. `traffic`, `expectations` and
`aware_planner` give each planner the predicted paths of the other vehicles. `result` and `archive`
hold what was flown.
"""
