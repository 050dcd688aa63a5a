"""The robot follows the paper's path in closed loop, once with what it weighs at the tip unknown, once estimated."""

from pathlib import Path

from ctcr.robot import robot_file
from ctcr.track import scenario
from ctcr.track.runs import run_once, system_values

HERE = Path(__file__).parent
robot = robot_file.load(HERE / "robots" / "table2.yaml")
wanted = scenario.load(HERE / "data" / "scenarios" / "S3.yaml", robot.n_tubes)

# The plant bends more than the controller's model believes.
plant = robot.model_copy(deep=True)
plant.tubes[0].youngs_modulus_GPa = 52.0

for controller in ("unknown", "estimated"):
    wanted.load.controller = controller
    run = run_once(wanted, system_values(robot), system_values(plant), mass_g=20.0)
    error = 1e3 * run.counted
    print(f"{controller:10} mean {error.mean():.3f} mm, largest {error.max():.3f} mm: {run.verdict()}")
print("force the controller found:", (1e3 * run.force[-1]).round(), "mN")
