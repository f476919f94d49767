"""Flying what a campaign lacks: attempts, workers and the SQLite file."""
