"""Simulated devices of the bench: they speak the devices' protocols, so that any program takes them for real ones."""
