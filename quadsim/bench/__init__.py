"""Benchmarks of control steps and their parts, flights along gates, environments, and peers.

`race bench` prints the results as tables.
"""
