"""`race bench`: how long a control step takes, where the time goes, and how others do on the same
model."""
