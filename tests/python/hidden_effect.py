"""A robot with effects that a test hides in its readings."""

import ctcr
from ctcr import effect_fit
from ctcr.effect_settings import settings


def hidden(robot, **given) -> ctcr.robot_file.Robot:
    values = settings([f"{name.replace('__', '.')}={value}" for name, value in given.items()], robot)
    return effect_fit.with_values(robot, list(dict.fromkeys(name.split(".")[1] for name in values)), values)
