"""The catalogue of physical effects, and effects that users write in Python."""
