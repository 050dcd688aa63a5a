"""A robot from its file, where its tip is, and what shape it takes."""

from pathlib import Path

import ctcr

robot = ctcr.robot_file.load(Path(__file__).parent / "robots" / "table2.yaml")
model = ctcr.Model(robot)

# Where the tubes are grasped (behind the front plate) [m] and how far they are turned [rad], innermost tube first;
# a weight of 10 g at the tip [N].
beta, alpha = [-0.30, -0.22, -0.13], [0.0, 1.0, 2.0]
weight = [0, -0.0981, 0]

# predict() takes many configurations at once, one in a row.
tip = model.predict([beta], [alpha], weight)
x, y, z = 1e3 * tip.position[0]
print("solved" if tip.solved[0] else ctcr.model.status_text(tip.status[0]))
print(f"tip position [mm]  {x:7.2f} {y:7.2f} {z:7.2f}")
print("tip quaternion    " + "".join(f"{component:8.4f}" for component in tip.quaternion[0]))

# The centreline at uniform places and every breakpoint, and how strongly it is bent there.
shape = model.shape(beta, alpha, weight, points=5)
print("\n s [mm]    x [mm]    y [mm]    z [mm]  curvature of tube 1 [1/m]")
for s, (x, y, z), curvature in zip(shape.arc_length, 1e3 * shape.position, shape.tube_curvature[0], strict=True):
    bending = (curvature[0] ** 2 + curvature[1] ** 2) ** 0.5
    print(f"{1e3 * s:7.1f} {x:9.2f} {y:9.2f} {z:9.2f} {bending:10.2f}")
