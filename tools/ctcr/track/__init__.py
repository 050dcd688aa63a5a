"""Scenarios of closed-loop control: a robot file, a scenario file, and their results."""
