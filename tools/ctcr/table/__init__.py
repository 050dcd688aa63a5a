"""Tables of measurements and how they are read."""
