"""The measuring bench: devices, their simulators and recordings."""
