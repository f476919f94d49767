"""Benchmarks: control steps and their parts, flights along gates, environments, peers.

`race bench` prints the results as tables.
"""
