"""The search of planner parameters."""
