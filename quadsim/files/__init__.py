"""Files read strictly and written whole.

Every mistake in a file is one line with its place, its unit and what was found.
"""
