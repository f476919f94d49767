"""Campaigns: many flights, each flown once and kept, and what they say together."""
