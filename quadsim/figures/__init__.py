"""Figures of stored flights, the only place besides quadsim.paper that draws with matplotlib."""
