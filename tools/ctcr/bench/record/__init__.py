"""Measurements recorded on the bench: a plan is run, every reading is in the file as soon as it is made."""
