"""A demonstration: the tools together, told as one story."""
