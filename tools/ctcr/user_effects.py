"""What a file with effects of one's own imports; see `ctcr.effects.user_effects`."""

from ctcr.effects.user_effects import Effect, Parameter, Rows, load

__all__ = ["Effect", "Parameter", "Rows", "load"]
