"""Figures of stored flights, the only place besides quadsim.app.paper that draws with matplotlib."""
