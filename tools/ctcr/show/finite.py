"""Numbers that people type, of an option or as the answer to a question: finite ones alone."""

import math

import click


class Finite(click.FloatRange):
    """A number in a range. NaN would pass every comparison with a limit, so it and infinities are refused here."""

    def convert(self, value, param, ctx) -> float:
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value!r} is not a finite number.", param, ctx)
        return number
