"""Heats. A heat is a race of several vehicles in one world.

`settings`, `line_up` and `spec` define the entrants and the rules, and `grid` the starts. `launch`
and `loop` fly the heat, and `marshal` and `rules` decide about contacts. `traffic`, `expectations`
and `aware_planner` give each planner the predicted paths of the other vehicles. `result` and
`archive` make and store the results.
"""
