"""Learned controllers (pilots), with their observations, networks and files."""
