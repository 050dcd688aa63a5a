"""Names for a file that defines effects; see `ctcr.effects.user_effects`."""

from ctcr.effects.user_effects import Effect, Parameter, Rows, load

__all__ = ["Effect", "Parameter", "Rows", "load"]
