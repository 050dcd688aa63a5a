"""Control and calibration with the devices: what needs a running bench is in on_bench_live.py."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from ctcr import robot_file
from ctcr.devices import bench_file
from ctcr.errors import InputError
from ctcr.track import scenario as scenario_file
from ctcr.track.live import within
from ctcr.track.runs import run_once, system_values
from ruamel.yaml import YAML

sys.path.insert(0, str(Path(__file__).parent))
from simulated_bench import ROBOT, ROOT, ctcr, skip_without_bench  # noqa: E402

ON_BENCH = Path(__file__).parent / "on_bench_live.py"
DATA = ROOT / "examples" / "data"
HOMES = [3.0, -1.5, 2.5]  # [deg], of the robot on the bench; its file says 0
T_REF = ([-59.6, 20.3, -180.5], [0.004, 1.203, 0.297])  # [mm], [rad]


@pytest.fixture
def robot():
    return robot_file.load(ROBOT)


@pytest.fixture
def bench():
    return bench_file.load(DATA / "bench" / "bench.yaml")


@pytest.fixture
def scenario():
    return scenario_file.load(DATA / "bench" / "track.yaml", 3)


class Ideal:
    """A device in Python that moves at once and reads what the model says."""

    def __init__(self, robot, start):
        from ctcr import Model
        from ctcr.frames import base_to_tracker, matrix_from_quaternion

        self.robot, self.joints, self.rows = robot, np.array(start), []
        self._model, self._to_tracker, self._matrix = Model(robot), base_to_tracker, matrix_from_quaternion

    def measure(self):
        n = self.robot.n_tubes
        tip = self._model.predict(self.joints[None, :n], self.joints[None, n:], np.zeros((1, 3)))
        position, quaternion = self._to_tracker(self.robot.tracker, tip.position, tip.quaternion)
        known = self.robot.actuation
        ratios = np.repeat([known.translation_mm_per_rev / 2e3 / np.pi, known.rotation_rev_per_rev], n)
        self._ratios = ratios
        homes = np.concatenate(
            [1e-3 * np.array(known.home_translation_mm), np.deg2rad(known.home_rotation_deg)]
        )
        return (self.joints - homes) / ratios, position[0], self._matrix(quaternion[0])

    def record(self, so_far, row):
        self.rows.append(so_far.tip[row].copy())

    def move(self, velocity, period):
        self.joints += self._ratios * velocity * period


def test_a_device_in_python_is_controlled_as_the_simulated_robot_is(robot, scenario):
    scenario.noise_mm, values = 0.0, system_values(robot)
    start = [*(1e-3 * np.array(scenario.start.beta_mm)), *np.deg2rad(scenario.start.alpha_deg)]
    device = Ideal(robot, start)
    here, there = run_once(scenario, values, device, 0.0), run_once(scenario, values, values, 0.0)
    np.testing.assert_allclose(here.tip, there.tip, atol=1e-7)  # the integrators differ
    np.testing.assert_allclose(here.joints, there.joints, atol=1e-5)
    np.testing.assert_array_equal(device.rows, here.tip)


@pytest.mark.parametrize("where", ["measure", "record", "move"])
def test_what_a_device_raises_ends_the_run(robot, scenario, where):
    start = [*(1e-3 * np.array(scenario.start.beta_mm)), *np.deg2rad(scenario.start.alpha_deg)]
    device = Ideal(robot, start)

    def fails(*_):
        raise InputError([])

    setattr(device, where, fails)
    with pytest.raises(InputError):
        run_once(scenario, system_values(robot), device, 0.0)
    assert len(device.rows) == 0


def test_the_limits_are_those_of_bench_and_scenario(robot, bench, scenario):
    scenario.limits.beta_high_mm = [-250.0, -210.0, 0.0]
    scenario.limits.base_gap_mm = 56.5
    scenario.tasks.feedback_per_s = 30.0
    limits = within(scenario, bench, robot).limits
    braking = 10**2 / (2 * 10 / 0.2)  # mm
    assert limits.base_gap_mm == 56.5 and limits.tip_gap_mm == 2 * braking
    assert limits.translation_mm_s == 10 and limits.rotation_deg_s == pytest.approx(60)
    np.testing.assert_allclose(limits.beta_high_mm, [-250, -210, -101])
    np.testing.assert_allclose(limits.beta_low_mm, [-464, -334, -199])
    assert within(scenario, bench, robot).tasks.feedback_per_s == 15
    scenario.rate_Hz = 100.0
    with pytest.raises(InputError, match="the tracker sets the pace, 40 Hz"):
        within(scenario, bench, robot)


def on_bench(tmp_path, *options):
    """The tests of ON_BENCH around a robot whose homes and tracker frame are not those of the file that they use."""
    skip_without_bench()
    document, real = YAML().load(ROBOT), tmp_path / "real.yaml"
    document["actuation"]["home_rotation_deg"] = HOMES
    document["tracker"]["position_mm"], document["tracker"]["rotation_vector_rad"] = T_REF
    YAML().dump(document, real)
    command = ctcr(
        "sim", "bench", real, "--folder", tmp_path / "folder", "--",
        sys.executable, "-m", "pytest", "-q", "-s", "--durations=9", "-p", "no:cacheprovider", "-p", "no:xdist",
        ON_BENCH, *options,
    )  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=900)
    print(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout


def test_on_the_simulated_bench(tmp_path):
    on_bench(tmp_path)


@pytest.mark.slow
def test_more_on_the_simulated_bench(tmp_path):
    on_bench(tmp_path, "-m", "slow")
