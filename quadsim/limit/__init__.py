"""The least time in which a vehicle can fly a course by its rules: time-optimal races, found by
optimisation."""
