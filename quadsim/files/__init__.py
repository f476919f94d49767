"""Reading files strictly: every mistake is one line with its place, its unit and what was found."""
