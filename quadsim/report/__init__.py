"""Reports of runs: their metrics, texts and tables, all made of a RecordedRun."""
