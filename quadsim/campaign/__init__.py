"""Campaigns: many flights, each flown once and kept, and their statistics."""
