"""Reports of runs: metrics, texts and tables, which are made from a RecordedRun."""
