"""Learned controllers: what a pilot observes, the network that it is, and its file."""
