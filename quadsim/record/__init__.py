"""The records of flights: runs, their folders on the disk, and the metrics computed from them."""
