"""The least time in which a vehicle can fly a course by its rules, found by optimisation."""
