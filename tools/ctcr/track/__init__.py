"""Scenarios of closed-loop control: a robot file, a scenario file, and what became of them."""
