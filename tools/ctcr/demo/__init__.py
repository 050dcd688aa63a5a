"""Demonstrations: what the tools do together, told as one story."""
