"""The whole way in Python: compare, find the missing effect, add it, compare again. See docs/python.md."""

from pathlib import Path

import ctcr

data = Path(__file__).parent / "data" / "demo"
robot = ctcr.load(data / "robot.yaml")
table = ctcr.read(data / "measurements.csv")
few = table.rows(slice(0, 240, 3))  # a part of it, for speed

before: ctcr.Comparison = ctcr.compare(robot, few)
print(before)

found: ctcr.Diagnosis = ctcr.diagnose(robot, few)
print(found)

better: ctcr.Added = ctcr.add(robot, found, few)
print(better)
for name, value in better.parameters().items():
    print(f"{name:32} {value['value']:9.5f} ± {value['sd']:.5f}")

after = ctcr.compare(better.robot, few)
print(f"{before.position_mm.rms:.2f} mm RMS before, {after.position_mm.rms:.2f} mm with {', '.join(better.ids)}")

# A row that the model cannot solve is NaN, and says why.
tips = ctcr.predict(better.robot, few, frame="tracker")
print(f"{tips.solved.sum()} of {len(few)} rows solved: {sorted(set(tips.why))}")
