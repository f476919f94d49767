"""Pictures for perception: what a camera on the vehicle sees of a course, with labels."""
