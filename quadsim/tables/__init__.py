"""Settings in readable form: listings, tables, commands, and the files generated from them."""
