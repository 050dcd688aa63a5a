"""`ctcr effects`: the physical effects that a robot may have beyond the standard model."""

from dataclasses import replace
from itertools import groupby
from math import isinf

import click

from ctcr.commands import options

_NEEDS = {
    "order": "rows in the order measured",
    "time": "times",
    "orientation": "orientation",
    "loads": "several known loads",
    "gravity": "gravity's direction",
}


@click.command(name="effects")
@click.argument("name", required=False)
@options.effects
@options.setting("--tubes", click.IntRange(1, 4), 3, "Tubes of the robot, for full names.")
@options.json
def command(name: str | None, tubes: int, out) -> None:
    """List the physical effects, or describe one.

    These are effects that a robot may have beyond the standard model. The description of the effect NAME says how
    the effect shows in measurements, what to measure to see it, and its parameters with their units, standard
    deviations and bounds.

    Example: ctcr effects friction
    """
    from ctcr.effects import catalogue

    shown = [catalogue.get(name, tubes)] if name else list(catalogue.all_effects(tubes).values())
    data = [_as_data(effect) for effect in shown]
    out.write_json(data[0] if name else {"effects": data})
    if out.json_target == "-":
        return
    out.console.soft_wrap = False
    if name:
        _describe(out.console, shown[0])
        return
    columns = ["id", "name", "the data need", "looks like"]
    rows = [[e.id, e.title, ", ".join(need for need in _NEEDS if need in e.needs), list(e.look_alikes)] for e in shown]
    out.table(f"{len(shown)} physical effects", columns, rows, 4)
    out.console.print("ctcr effects ID describes how an effect shows in the data and what to measure to see it.")


def _describe(console, effect) -> None:
    from rich.table import Table

    from ctcr.show.output import table

    needs = ", ".join(_NEEDS[need] for need in _NEEDS if need in effect.needs) or "nothing special"
    console.print(f"{effect.title}  ({effect.id})", style="bold")
    console.print()
    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="bold", no_wrap=True)
    for title, text in (
        ("what happens", effect.physics),
        ("how it looks", effect.signature),
        ("what to measure", effect.measure),
        ("the data need", needs),
        ("looks like", ", ".join(effect.look_alikes) or "no other"),
        ("reference", effect.reference),
        *((name, p.meaning) for name, p in _families(effect)),
    ):
        if text:
            facts.add_row(title, text)
    console.print(facts)
    rows = [
        [name, p.unit or "-", p.kind, f"{p.neutral:.4g}", f"{p.sigma:.3g}", _interval(p.soft), _interval(p.hard)]
        for name, p in _families(effect)
    ]
    columns = ["parameter (SI)", "unit", "kind", "neutral", "sd", "usual", "possible"]
    console.print()
    console.print(table("", columns, rows, text=(0, 1, 2, 5, 6)))


def _families(effect):
    """Parameters that differ in nothing but their names, together: what they are called, and the first of them."""
    for _, alike in groupby(effect.parameters, lambda p: replace(p, name="", full_names=())):
        first, *others = alike
        name = _shown_name(first)
        yield (f"{name} ... {_shown_name(others[-1])}" if len(others) > 1 else name), first
        if len(others) == 1:
            yield _shown_name(others[0]), others[0]


def _shown_name(p) -> str:
    return f"{p.name}.1..{len(p.full_names)}" if p.per_tube and len(p.full_names) > 1 else p.name


def _interval(limits: tuple[float, float]) -> str:
    low, high = limits
    if isinf(low) and isinf(high):
        return "any"
    if isinf(low) or isinf(high):
        return f"<= {high:.3g}" if isinf(low) else f">= {low:.3g}"
    return f"{low:.3g} to {high:.3g}"


# JSON keys and the members that they show.
_EFFECT = ("id", "title", "physics", "signature", "measure", "needs", "look_alikes", "reference")
_PARAMETER = {
    **{key: key for key in ("name", "full_names", "unit", "kind", "neutral")},
    **{"sd": "sigma", "usual": "soft", "possible": "hard"},
    **{key: key for key in ("per_tube", "meaning")},
}


def _as_data(effect) -> dict:
    parameters = [{key: getattr(p, member) for key, member in _PARAMETER.items()} for p in effect.parameters]
    for p in parameters:
        if p["kind"] == "amplitude":
            p["kind"] = "strength"  # the word of the JSON format
    return {key: getattr(effect, key) for key in _EFFECT} | {"needs": sorted(effect.needs), "parameters": parameters}
