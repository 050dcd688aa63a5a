"""Which effects of a robot act on the poses of its tubes, and which of these depend on the path."""

from typing import Any

from ctcr.effects import catalogue
from ctcr.robot.description import Robot


def of_the_poses(robot: Robot) -> dict[str, Any]:
    """The robot's effects that change the poses of its tubes: all but those of the tracker alone."""
    alone = {effect.id for effect in catalogue.catalogue(robot.n_tubes).values() if effect.acts_on == {"reading"}}
    return {identity: given for identity, given in robot.effects.items() if identity not in alone}


def of_the_path(robot: Robot) -> list[str]:
    """The robot's effects that depend on the path to a configuration, and all effects of users' files."""
    known = catalogue.catalogue(robot.n_tubes)
    without = {effect.id for effect in known.values() if not effect.needs & {"order", "time"}}
    return [identity for identity in of_the_poses(robot) if identity not in without]


def without_the_path(robot: Robot) -> Robot:
    """The robot without those effects: what a `Model` can solve, configuration by configuration."""
    path = of_the_path(robot)
    return robot.with_effects({identity: given for identity, given in robot.effects.items() if identity not in path})
