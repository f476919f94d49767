"""Settings as people read them: listings, tables, commands, and the files generated from them."""
