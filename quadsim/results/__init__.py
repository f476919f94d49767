"""The results that the library returns: Run of a flight, Heat of a race, and lists of them."""
