"""How the tip moves with the joints (J) and a load (C), and how good it is to trust them for small changes."""

from pathlib import Path

import ctcr
import numpy as np
from ctcr.arrays import Array

model = ctcr.Model(ctcr.robot_file.load(Path(__file__).parent / "robots" / "table2.yaml"))
q = np.array([-0.30, -0.22, -0.13, 0.0, 1.0, 2.0])  # beta_1..3 [m], alpha_1..3 [rad]


def print_millimetres(what: str, translation: Array) -> None:
    print(f"{what:34}", *(f"{1e3 * component:8.4f}" for component in translation), "mm")


# J: 6 x 6, columns as q. C: 6 x 6, columns force [N], moment [N m].
# Rows of both: the tip's translation [m] and rotation [rad], base frame. Exact, and computed with the pose.
here = model.predict([q[:3]], [q[3:]], derivatives=True)
assert here.jacobian is not None and here.compliance is not None  # as derivatives were asked for
J, C = here.jacobian[0], here.compliance[0]

# Push tube 1 by 0.5 mm and turn tube 2 by 1 degree.
change = np.array([0.5e-3, 0, 0, 0, 0.0175, 0])
moved = model.predict([(q + change)[:3]], [(q + change)[3:]])
print_millimetres("small move: predicted by J", (J @ change)[:3])
print_millimetres("small move: solved", moved.position[0] - here.position[0])

# Hang 10 g on the tip: in this robot's file y points up.
weight = np.array([0, -0.010 * 9.81, 0])
loaded = model.predict([q[:3]], [q[3:]], weight)
print_millimetres("10 g at the tip: predicted by C", C[:3, :3] @ weight)
print_millimetres("10 g at the tip: solved", loaded.position[0] - here.position[0])
