"""The robot on the simulated bench: off its file in every calibrated parameter, with an effect that the file lacks."""

import numpy as np

from ctcr.effects import catalogue
from ctcr.model import simulation
from ctcr.robot.description import Robot

EFFECT, VALUE = "friction", 0.02  # coefficient of every tube
SEED = 4
SHIFT_MM, TURN_DEG = ((9.0, -6.0, 7.0), (3.0, -2.5, 2.0))  # of the tracker, and of the tubes at home, if misplaced


def hidden_robot(known: Robot, misplaced: bool) -> Robot:
    """The robot on the bench; `known`: the robot file."""
    built = simulation.as_built(known, np.random.default_rng(SEED))
    if misplaced:
        built.tracker.position_mm = list(np.add(built.tracker.position_mm, SHIFT_MM))
        built.actuation.home_rotation_deg = list(np.add(built.actuation.home_rotation_deg, TURN_DEG))
    values = {f"effects.{EFFECT}.coefficient.{i + 1}": VALUE for i in range(known.n_tubes)}
    return catalogue.with_values(built, [EFFECT], values)
