"""One flight: rules and referee, clock, and the loop of control steps."""
