"""`ctcr effects`: the physical effects that a robot may have beyond the standard model."""

import click

_NEEDS = {
    "order": "rows in the order measured",
    "time": "times",
    "orientation": "orientation",
    "loads": "several known loads",
    "gravity": "gravity's direction",
}


@click.command(name="effects")
@click.argument("name", required=False)
@click.option("--effects", "own", multiple=True, metavar="FILE.py", help="Show the effects of this file too.")
@click.option(
    "--tubes", type=click.IntRange(1, 4), default=3, show_default=True, help="Tubes of the robot, for full names."
)
@click.option("--json", "json_target", metavar="FILE", help="Write it as JSON; - for standard output.")
def command(name: str | None, own: tuple[str, ...], tubes: int, json_target: str | None) -> None:
    """List the physical effects that can be added to a robot, or tell everything about the effect NAME."""
    from ctcr.effects import catalogue, user_effects
    from ctcr.show import output

    user_effects.load_all(own)
    shown = [catalogue.get(name, tubes)] if name else list(catalogue.all_effects(tubes).values())
    if json_target:
        data = [_as_data(effect) for effect in shown]
        output.write_json(data[0] if name else {"effects": data}, json_target)
        if json_target == "-":
            return
    console = output.console()
    if name:
        _tell(console, shown[0])
    else:
        _list(console, shown)


def _list(console, shown) -> None:
    from ctcr.show.output import table

    rows = [
        [
            effect.id,
            effect.title,
            ", ".join(need for need in _NEEDS if need in effect.needs),
            "\n".join(effect.look_alikes),
        ]
        for effect in shown
    ]
    columns = ["id", "what it is", "the data need", "looks like"]
    console.soft_wrap = False
    console.print(table(f"{len(shown)} physical effects", columns, rows, 4))
    console.print("ctcr effects ID tells how one looks in the data and what to measure to see it.")


def _tell(console, effect) -> None:
    from rich.table import Table

    from ctcr.show.output import table

    needs = ", ".join(_NEEDS[need] for need in _NEEDS if need in effect.needs) or "nothing special"
    console.soft_wrap = False
    console.print(f"[bold]{effect.title}[/bold]  ({effect.id})\n")
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
    from dataclasses import replace
    from itertools import groupby

    for _, alike in groupby(effect.parameters, lambda p: replace(p, name="", full_names=())):
        first, *others = alike
        name = _shown_name(first)
        yield (f"{name} ... {_shown_name(others[-1])}" if len(others) > 1 else name), first
        if len(others) == 1:
            yield _shown_name(others[0]), others[0]


def _shown_name(p) -> str:
    return f"{p.name}.1..{len(p.full_names)}" if p.per_tube and len(p.full_names) > 1 else p.name


def _interval(limits: tuple[float, float]) -> str:
    from math import isinf

    low, high = limits
    if isinf(low) and isinf(high):
        return "any"
    if isinf(low) or isinf(high):
        return f"<= {high:.3g}" if isinf(low) else f">= {low:.3g}"
    return f"{low:.3g} to {high:.3g}"


def _as_data(effect) -> dict:
    return {
        "id": effect.id,
        "title": effect.title,
        "physics": effect.physics,
        "signature": effect.signature,
        "measure": effect.measure,
        "needs": sorted(effect.needs),
        "look_alikes": effect.look_alikes,
        "reference": effect.reference,
        "parameters": [
            {
                "name": p.name,
                "full_names": p.full_names,
                "unit": p.unit,
                "kind": p.kind,
                "neutral": p.neutral,
                "sd": p.sigma,
                "usual": p.soft,
                "possible": p.hard,
                "per_tube": p.per_tube,
                "meaning": p.meaning,
            }
            for p in effect.parameters
        ],
    }
