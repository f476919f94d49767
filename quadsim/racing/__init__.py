"""Rules and flights: the referee, the clock, the loop of control steps."""
