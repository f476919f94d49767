"""Learned controllers: what a pilot observes, and the pilot with its file."""
