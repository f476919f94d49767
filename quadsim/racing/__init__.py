"""One flight: its rules and referee, its clock, its loop of control steps."""
