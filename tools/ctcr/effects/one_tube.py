"""A robot of one tube: a tube of a robot that alone stands out of the front plate, with the sensor on it."""

from ctcr.effects import catalogue
from ctcr.robot.description import Robot


def one_tube(robot: Robot, tube: int) -> Robot:
    """The robot whose tube of this index (0: innermost) alone stands out of the plate, with its effects.

    The other tubes are straight behind the plate and do not act on it. Raises InputError as `catalogue.value_of`.
    """
    actuation = {
        name: [value[tube]] if isinstance(value, list) else value for name, value in vars(robot.actuation).items()
    }
    values = catalogue.value_of(robot)
    own = {
        identity: {
            p.name: [values[p.full_names[tube]]] if p.per_tube else values[p.full_names[0]]
            for p in catalogue.get(identity, robot.n_tubes).parameters
            if p.name in given
        }
        for identity, given in robot.effects.items()
    }
    changes = {
        "tubes": [robot.tubes[tube]],
        "actuation": robot.actuation.model_copy(update=actuation),
        "tracker": robot.tracker.model_copy(update={"sensor_on_tube": 1}),
        "effects": own,
    }
    return robot.model_copy(update=changes)
