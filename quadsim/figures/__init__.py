"""Figures of stored flights. Only this package and quadsim.paper draw with matplotlib."""
