"""Heats: races of several vehicles in one world, from their settings to what they leave behind."""
