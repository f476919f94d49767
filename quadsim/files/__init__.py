"""Read files strictly, and write them completely or not at all.

The error for a mistake in a file is one line with the place, the expected unit and the found value.
"""
