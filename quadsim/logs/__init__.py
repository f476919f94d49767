"""Flight logs of many kinds, read into one table of signals: see `read_logs`."""
