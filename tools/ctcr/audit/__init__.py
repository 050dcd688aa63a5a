"""Checks of a table before any fit: spikes, missing motion, an unknown sensor roll."""
