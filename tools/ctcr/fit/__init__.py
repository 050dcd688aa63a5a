"""The joint maximum a posteriori fit of any set of parameters to a table of readings."""
