"""Learned controllers (pilots): what a pilot observes, its network and its file."""
