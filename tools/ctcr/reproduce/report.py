"""The page: the paper's values, ours, their ratio, why they differ, and the figures."""

import numpy as np
from matplotlib.figure import Figure

from ctcr.reproduce.control import Scenarios
from ctcr.reproduce.influence import SLOW_FEEDBACK, Influence
from ctcr.reproduce.paper import COLUMNS, Claim, paper_robot
from ctcr.sensitivity import report as sensitivity
from ctcr.show import html_page
from ctcr.show.html_page import cards, figure, table, view
from ctcr.show.palette import AXES, ERROR, NOISE, PALE_BACK, PALE_OUT, TINT
from ctcr.track import figures as track
from ctcr.track.result import errors_mm
from ctcr.track.scenario import shipped


def page(claims: list[Claim], errors: dict, s: Scenarios, found: Influence, made: str, quick: bool) -> str:
    """The whole HTML text; `made` says how long it took."""
    title, wanted = "The paper and this library", shipped("S2")
    runs = {f"{name}, {mass:g} g": s.runs[name, mass][0] for name, mass in (("S2", 0.0), ("S3", 20.0), ("S4", 20.0))}
    shown = "fewer designs, configurations and repetitions than the paper" if quick else "as many as the paper"
    joints = (runs["S2, 0 g"], paper_robot(), wanted)
    slow = f"Figure 4. Wrong parameters in closed loop, with a feedback of {SLOW_FEEDBACK:g} 1/s."
    pictures = [
        (_integration, errors, 8, 3.4, "Figure 2. Error of one integration step a segment."),
        (_forces, s, 9, 3.4, "Figures 3b and 6. Tracking errors by weight, simulated."),
        (sensitivity.curves, found.slow, 10.4, 5.4, slow),
        (track.actuators, joints, 10.4, 3.6, "Figure 5. Actuators in S2."),
        (_beyond, s, 8, 3.4, "Beyond the paper: weights above 20 g. Dashed: 1 mm."),
        (sensitivity.bars, found.opened, 10.4, 8, "Wrong parameters in open loop (Section V.A)."),
    ]
    path = track.scene(list(runs.values()), wanted, list(runs))
    sections = [
        '<p class="lead">Boyer et al., On High Performance Control of Concentric Tube Continuum Robots through '
        "Parsimonious Calibration, RA-L 2024.</p>",
        cards([("good", str(len(claims)), "values of the paper beside ours"), ("noise", made, shown)]),
        table("Values", COLUMNS, [claim.row() for claim in claims], 3),
        "<h2>Table II: the robot</h2>" + _robot(),
        "<h2>Figure 3a: the path</h2>" + view(path, "The tip along the path, base frame."),
        "<h2>Figures 2 to 6</h2>",
        *(figure(*picture, wide=True) for picture in pictures),
    ]
    return html_page.page(title, sections)


def _robot() -> str:
    robot = paper_robot()
    columns = {
        ("offset (translation)", "mm"): robot.actuation.home_translation_mm,
        ("offset (rotation)", "deg"): robot.actuation.home_rotation_deg,
    }
    fields = {
        ("Young's modulus", "GPa"): "youngs_modulus_GPa",
        ("Poisson's ratio", ""): "poisson_ratio",
        ("precurvature", "1/m"): "curvature_per_m",
        ("precurved length", "mm"): "curved_length_mm",
        ("length", "mm"): "length_mm",
        ("inner diameter", "mm"): "inner_diameter_mm",
        ("outer diameter", "mm"): "outer_diameter_mm",
    }
    columns |= {key: [getattr(tube, name) for tube in robot.tubes] for key, name in fields.items()}
    rows = [[name, *(f"{x:g}" for x in values), unit] for (name, unit), values in columns.items()]
    return table("As in the paper: these are inputs", ["parameter", "tube 1", "tube 2", "tube 3", "unit"], rows, 1)


def _integration(picture: Figure, errors: dict[str, np.ndarray]) -> None:
    """Fig. 2: errors of one step a segment."""
    axes = picture.subplots()
    percent = {name: 100 * np.maximum(error, 1e-13) for name, error in errors.items()}
    track.box_plot(axes, percent, [PALE_OUT] * len(percent), means=False)
    axes.set(yscale="log", ylabel="tip error, % of the length")


def _forces(picture: Figure, s: Scenarios) -> None:
    """Fig. 3b and Fig. 6: errors by weight, up to 20 g."""
    axes, colour = picture.subplots(), {"S2": TINT, "S3": PALE_BACK, "S4": PALE_OUT}
    groups = [("S2", 0.0), *((name, mass) for name in ("S3", "S4") for mass in (5.0, 10.0, 15.0, 20.0))]
    errors = {f"{name}\n{mass:g} g": errors_mm(s.runs[name, mass]) for name, mass in groups}
    track.box_plot(axes, errors, [colour[name] for name, _ in groups])
    axes.set(ylabel="tracking error, mm")


def _beyond(picture: Figure, s: Scenarios) -> None:
    """The largest error by weight: the paper's scheme with unknown and known force, ours, and the least possible."""
    axes = picture.subplots()
    for scenario, colour, label in (
        ("S3", ERROR, "the paper's scheme, force unknown (S3)"),
        ("S4", AXES[1], "the paper's scheme, force known (S4)"),
        ("S5", AXES[0], "ours (S5)"),
    ):
        masses = sorted(mass for name, mass in s.runs if name == scenario)
        largest = [errors_mm(s.runs[scenario, mass]).max() for mass in masses]
        axes.plot(masses, largest, "o-", color=colour, label=label)
    least = {mass: 1e3 * away for mass, away in s.reach.items() if away > 0}
    axes.plot(list(least), list(least.values()), "k_", ms=16, mew=2, label="least of any posture within the limits")
    axes.axhline(1, color=NOISE, lw=1, ls="--")
    axes.set(yscale="log", xlabel="weight at the tip, g", ylabel="largest error, mm")
    axes.legend(fontsize=9)
