"""Comparisons and sweeps of flights."""
