"""Numbers and lists as the findings print them."""


def mm(value: float) -> str:
    """A length with its unit, to three digits at most."""
    return f"{value:.1f} mm" if value >= 10 else f"{value:.2f} mm" if value >= 0.1 else f"{value:.3f} mm"


def percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.1f} %"


def most(share: float) -> str:
    return f"{100 * share:.3g} %" if share < 0.999 else "more than 99.9 %"


def probability(value: float) -> str:
    return f"{value:.2g}" if value >= 1e-3 else "below 0.001"


def join(names: list[str] | tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
