"""The page: the paper's values, ours, their ratio, and why they differ."""

from pathlib import Path

from ctcr.reproduce import pictures
from ctcr.reproduce.control import Scenarios
from ctcr.reproduce.influence import SLOW_FEEDBACK, Influence
from ctcr.reproduce.paper import COLUMNS, Claim, paper_robot
from ctcr.sensitivity import figures as sensitivity_figures
from ctcr.show import html_page
from ctcr.show.html_page import cards, figure, table
from ctcr.show.output import atomic_writer
from ctcr.track import figures as track_figures
from ctcr.track.scenario import shipped
from ctcr.track.scene import scene


def write(
    target: str | Path, claims: list[Claim], errors: dict, s: Scenarios, found: Influence, made: str, quick: bool
) -> None:
    """Writes the page; `made` says how long it took. Raises InputError where the file cannot be written."""
    robot, wanted = paper_robot(), shipped("S2")
    runs = [s.runs[key][0] for key in (("S2", 0.0), ("S3", 20.0), ("S4", 20.0))]
    shown = "fewer designs, configurations and repetitions than the paper" if quick else "as many as the paper"
    sections = [
        "<h1>The paper and this library</h1>"
        '<p class="lead">Boyer et al., On High Performance Control of Concentric Tube Continuum Robots through '
        "Parsimonious Calibration, RA-L 2024.</p>",
        cards([("good", str(len(claims)), "values of the paper beside ours"), ("noise", made, shown)]),
        table("Values", COLUMNS, [claim.row() for claim in claims], 3),
        "<h2>Table II: the robot</h2>" + _robot(robot),
        '<h2>Figure 3a: the path</h2><div id="view"></div>',
        "<h2>Figures 2 to 6</h2>",
        figure(pictures.integration, errors, 8, 3.4, "Figure 2. Error of one integration step a segment.", wide=True),
        figure(pictures.forces, s, 9, 3.4, "Figures 3b and 6. Tracking errors by weight, simulated.", wide=True),
        figure(
            sensitivity_figures.curves,
            found.slow,
            10.4,
            5.4,
            f"Figure 4. Wrong parameters in closed loop, with a feedback of {SLOW_FEEDBACK:g} 1/s.",
            wide=True,
        ),
        figure(track_figures.actuators, (runs[0], robot, wanted), 10.4, 3.6, "Figure 5. Actuators in S2.", wide=True),
        figure(pictures.beyond, s, 8, 3.4, "Beyond the paper: weights above 20 g. Dashed: 1 mm.", wide=True),
        figure(
            sensitivity_figures.bars, found.opened, 10.4, 8, "Wrong parameters in open loop (Section V.A).", wide=True
        ),
    ]
    with atomic_writer(target) as file:
        file.write(
            html_page.page(
                "The paper and this library",
                sections,
                "ctcr reproduce",
                "ctcr reproduce",
                scene(runs, wanted, ["S2, 0 g", "S3, 20 g", "S4, 20 g"]),
            )
        )


def _robot(robot) -> str:
    a, columns = robot.actuation, ["parameter", "tube 1", "tube 2", "tube 3", "unit"]
    tubes = robot.tubes
    rows = [
        ["offset (translation)", *(f"{x:g}" for x in a.home_translation_mm), "mm"],
        ["offset (rotation)", *(f"{x:g}" for x in a.home_rotation_deg), "deg"],
        ["Young's modulus", *(f"{t.youngs_modulus_GPa:g}" for t in tubes), "GPa"],
        ["Poisson's ratio", *(f"{t.poisson_ratio:g}" for t in tubes), ""],
        ["precurvature", *(f"{t.curvature_per_m:g}" for t in tubes), "1/m"],
        ["precurved length", *(f"{t.curved_length_mm:g}" for t in tubes), "mm"],
        ["length", *(f"{t.length_mm:g}" for t in tubes), "mm"],
        ["inner diameter", *(f"{t.inner_diameter_mm:g}" for t in tubes), "mm"],
        ["outer diameter", *(f"{t.outer_diameter_mm:g}" for t in tubes), "mm"],
    ]
    return table("As in the paper: these are inputs", columns, rows, 1)
