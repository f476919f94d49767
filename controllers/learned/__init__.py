"""Learned controllers: the observation of a pilot, its network, and its file."""
