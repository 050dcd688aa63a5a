"""Colours of figures and pages: one colour means one thing in all of them."""

PALETTE = {  # on light paper, on dark paper
    "paper": ("#ffffff", "#14191f"),
    "ink": ("#1c2733", "#e2e8ed"),
    "soft": ("#5c6b78", "#a3b0bb"),
    "line": ("#dde3e8", "#35414c"),
    "tint": ("#f2f5f7", "#1e262e"),
    "error": ("#b3361e", "#ef7b62"),
    "good": ("#2e7d4f", "#5bb884"),
    "noise": ("#6b7785", "#93a0ad"),
    "out": ("#0b6e99", "#4fb0dc"),
    "back": ("#d17a00", "#f0a340"),
    "third": ("#4b8b3b", "#7cc06a"),
    "violet": ("#7a4fa3", "#b592da"),
    "pink": ("#c2699f", "#e091c0"),
    "faint": ("#c9d1d9", "#4a5763"),
    "low": ("#f3c623", "#8f7f35"),  # of an error by colour
    "middle": ("#e0662b", "#f0954a"),
    "high": ("#8c1d18", "#ff6a5e"),
    "pale_error": ("#f2cdc6", "#6e3429"),
    "pale_out": ("#cfe3ee", "#234b60"),
    "pale_back": ("#f6dcc0", "#6b4a20"),
}
INK, LINE, TINT, ERROR, GOOD, NOISE, OUT, BACK, FAINT, PALE_ERROR, PALE_OUT, PALE_BACK = (
    PALETTE[name][0] for name in "ink line tint error good noise out back faint pale_error pale_out pale_back".split()
)
AXES = (OUT, BACK, PALETTE["third"][0])


def colours(dark: bool) -> str:
    """The palette as properties of a style sheet, such as --ink."""
    return " ".join(f"--{name}: {pair[dark]};" for name, pair in PALETTE.items())
