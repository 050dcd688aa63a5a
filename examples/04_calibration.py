"""Fits the parameters of a robot to measured poses, judges the fit on runs it has not seen, writes the robot file."""

import tempfile
from pathlib import Path

import ctcr
import numpy as np
from ctcr.fit import joint
from ctcr.model import fields
from ctcr.robot import ledger

data = Path(__file__).parent / "data" / "calibration"
robot = ctcr.robot_file.load(data / "robot.yaml")
readings = ctcr.measurements.load(data / "measurements.csv", robot.n_tubes)

# Every fourth run is kept out of the fit. Never split single rows: neighbours on a path are alike.
held_out = readings.run % 4 == 3
fit = joint.fit(robot, readings, "standard", rows=~held_out)

print(f"nominal    {fit.nominal_rms_mm(held_out):6.3f} mm RMS on the runs held out")
print(f"calibrated {fit.rms_mm(held_out):6.3f} mm, expected error {fit.expected_mm(held_out):.3f} mm")
print(f"reduced chi-square {fit.reduced_chi_square:.2f}")

# Values in the units of the robot file. Posterior over prior near 1: the data do not determine it.
for item in fields.fitted(fit):
    print(
        f"{item.name:28s} {item.nominal:9.3f} -> {item.value:9.3f} ± {item.sd:.2g} {item.unit:4s}"
        f" posterior/prior {item.ratio:4.2f}"
    )
for direction in fit.directions:
    print("not determined:", direction.text)

# The new file keeps the comments of the old one, and the old values in its ledger.
calibrated = fit.apply(robot)
with tempfile.TemporaryDirectory() as folder:
    entry = ledger.Entry("example 04", [data / "measurements.csv"], {"rms_mm": {"held_out": fit.rms_mm(held_out)}})
    changes = fields.changes(fit, robot, calibrated)
    written = ledger.write(robot, Path(folder) / "calibrated.yaml", changes, entry)
    print("changed:", ", ".join(change["field"] for change in written.history[-1]["changes"][:3]), "...")

# Joints in a table are those of the controller that recorded it: correct them for the homes found since.
beta, alpha = calibrated.joints_of_table(readings.beta, readings.alpha)
tips = ctcr.Model(calibrated).predict(beta, alpha, readings.force)
print("solved:", int(np.sum(tips.solved)), "of", len(readings))
