"""Learned controllers (pilots): observations, network and file."""
