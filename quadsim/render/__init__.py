"""Pictures for perception: a course as a camera on the vehicle sees it, with labels."""
