"""Figures of stored flights. Besides quadsim.paper, only these draw with matplotlib."""
