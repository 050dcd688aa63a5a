"""Effects that were added, as one HTML page that needs nothing else: how far the error falls first."""

from ctcr.diagnose.add import Added
from ctcr.diagnose.report import fitted_values
from ctcr.effects import catalogue
from ctcr.robot import history
from ctcr.show import html_page
from ctcr.show.html_page import bullets, cards, paragraph
from ctcr.show.wording import listed, short


def page(added: Added) -> str:
    """The whole HTML text."""
    effects = [catalogue.get(identity, added.before.n_tubes) for identity in added.ids]
    rms = {name: f"{short(value)} mm" for name, value in added.rms("rms_mm").items()}
    on = f"on held-out data ({added.held_out})" if added.held_out else "on the rows that were fitted"
    numbers = [
        ("error", rms["nominal"], "RMS error with the robot file"),
        ("error", rms["calibrated"], "after calibration"),
        ("good", rms[added.ids[-1]], f"with {listed(added.ids)}"),
        ("noise", f"{short(added.floors.expected_error_mm)} mm", added.floors.MEANING),
    ]
    sections = [
        *(paragraph(f" ({one.id}). {one.physics}", "lead", bold=one.title) for one in effects),
        cards(numbers),
        "<h2>The error falls</h2>" + history.figure(added.steps, f"RMS error of each step, {on}."),
        "<h2>To know</h2>" + bullets(added.notices) if added.notices else "",
        fitted_values(added.fit, added.after, added.readings.sessions),
    ]
    return html_page.page(f"Added: {added.before.name}", sections, added.files)
