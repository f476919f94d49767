"""Results as the library returns them: Run of a flight, Heat of a race, and lists of them."""
