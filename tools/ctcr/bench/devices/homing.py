"""Homing by flush retraction: the length of a tube whose tip is flush with the plate tells where it is grasped.

The procedure of the paper (section V.B) in reverse: there it measures lengths at a known home position.
"""

from collections.abc import Callable

import numpy as np

from ctcr.bench.devices.axis_control import JOG_M
from ctcr.bench.devices.fault import DeviceFault
from ctcr.bench.devices.motors import Motors
from ctcr.bench.devices.person import Person
from ctcr.bench.shared.transmission import home_joints
from ctcr.robot.description import Robot

FLUSH_M = 5e-5  # nearer to the plate than anybody sees
MOST_STEPS = 200


def home(motors: Motors, robot: Robot, person: Person, say: Callable[[str], None]) -> None:
    """Retracts every tube until flush, then sets the joints.

    The outermost tube first; those inside it move along, which keeps the order of grasped points and of tips all the
    time. Rotations count as home where they stand: turn them to their marks before. Raises DeviceFault.
    """
    n = robot.n_tubes
    moved = np.zeros(n)  # [m], since the start
    flush = np.zeros(n)  # `moved` when flush
    for tube in reversed(range(n)):
        say(f"tube {tube + 1}: retracting until its tip is flush with the plate")
        for _ in range(MOST_STEPS):
            out = person.deployed(tube)
            if abs(out) < FLUSH_M:
                break
            way = np.zeros(2 * n)
            way[: tube + 1] = -np.clip(out, -JOG_M, JOG_M)
            motors.jog(way)
            motors.wait()
            moved += way[:n]
        else:
            text = f"tube {tube + 1} is not flush after {MOST_STEPS} moves"
            raise DeviceFault("homing", text, "does its motor move the tube that the bench file says?")
        flush[tube] = moved[tube]
    joints = home_joints(robot)
    joints[:n] = moved - flush - robot.lengths
    motors.set_joints(joints)
