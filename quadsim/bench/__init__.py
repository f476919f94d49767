"""Measurements of speed: control steps and their parts, flights along gates, environments, peers.

`race bench` prints them as tables.
"""
