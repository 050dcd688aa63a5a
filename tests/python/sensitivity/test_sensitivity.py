"""The sensitivity study: against the model itself, on other workers, after interruptions, and its advice."""

import json
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from ctcr.cli import cli
from ctcr.errors import InputError
from ctcr.frames import base_to_tracker
from ctcr.model import parameters
from ctcr.model.model import Model
from ctcr.reproduce.paper import random_rows
from ctcr.sensitivity import closed_loop, open_loop
from ctcr.sensitivity.advice import advise, grouped
from ctcr.sensitivity.ranges import all_varied, together
from ctcr.sensitivity.work import workers
from ctcr.track import scenario as scenario_file

ROOT = Path(__file__).parents[3]
ROBOT = ROOT / "examples/robots/table2.yaml"
S2 = ROOT / "examples/data/scenarios/S2.yaml"
COUNT = 2500


@pytest.fixture(scope="module")
def varied(robot):
    return all_varied(robot)


@pytest.fixture(scope="module")
def whole(robot, varied):
    return open_loop.study(robot, varied, COUNT)


def test_ranges(robot, varied):
    """The paper's ranges; a parameter varies alone."""
    assert len(varied) == 3 * 8 + 6
    names, nominal = parameters.names_of(3), parameters.values(robot)
    for one in varied:
        assert np.array_equal(one.at(0.0), nominal)
        changed = {names[i] for fraction in (-1, 1) for i in np.flatnonzero(one.at(fraction) != nominal)}
        assert len(changed) == (3 if one.kind.startswith("tracker rotation") else 1), one.name
    ends = {one.name: (one.low, one.high, one.unit) for one in varied}
    assert ends["length, tube 2"] == (-5, 5, "mm") and ends["Young's modulus, tube 1"] == (-15, 15, "GPa")
    assert ends["Poisson's ratio, tube 3"][:2] == pytest.approx((-0.3, 0.2))
    inner = names.index("tubes.1.inner_diameter")
    wall = next(one for one in varied if one.name == "wall thickness, tube 1")
    assert robot.tubes[0].outer_diameter - wall.at(1.0)[inner] == pytest.approx(1.15 * 0.22e-3)


def test_tracker_shift(whole):
    """A shift of the tracker moves every tip as much."""
    for one in whole.influences:
        if one.name.startswith("tracker position"):
            assert one.mean == pytest.approx(3) and one.maximum == pytest.approx(3)


def test_influence(robot, varied, whole):
    """Other random configurations, solved by the model one by one: means agree within their spread."""
    beta, alpha, force = random_rows(robot, 3000, np.random.default_rng(3), 0.3)
    nominal = Model(robot, steps=1).predict(beta, alpha, force)
    for name, other in (
        ("precurvature, tube 3", parameters.applied(robot, ["tubes.3.curvature"], [7.7])),
        ("Young's modulus, tube 1", parameters.applied(robot, ["tubes.1.youngs_modulus"], [73e9])),
    ):
        there = Model(other, steps=1).predict(beta, alpha, force)
        a, _ = base_to_tracker(robot.tracker, nominal.position, nominal.quaternion)
        b, _ = base_to_tracker(robot.tracker, there.position, there.quaternion)
        distance = 1e3 * np.linalg.norm(a - b, axis=1)
        one = single_end(robot, varied, name)
        assert one.mean == pytest.approx(distance.mean(), rel=0.1), name


def single_end(robot, varied, name):
    one = next(v for v in varied if v.name == name)
    only = replace(one, at=lambda fraction: one.at(abs(fraction)))  # both ends are the upper one
    return open_loop.study(robot, [only], 3000).influences[0]


def test_together(robot, varied):
    """All varied parameters are varied together, within their ranges."""
    low, high = together(robot, varied)
    names = parameters.names_of(3)
    spread = {name for name, a, b in zip(names, low, high, strict=True) if a < b}
    assert len(spread) == 3 * 8 + 6 and (low <= high).all()
    assert high[names.index("tracker.rotation.x")] == pytest.approx(np.radians(3))


def test_workers(robot, varied, whole, monkeypatch):
    """Results do not depend on the division into jobs."""
    monkeypatch.setattr(open_loop, "CHUNK", 1)
    assert open_loop.study(robot, varied, COUNT) == whole


def test_resume(robot, varied, whole, tmp_path, monkeypatch):
    """An interrupted study resumes with the same result; another study is refused."""
    monkeypatch.setattr(open_loop, "CHUNK", 1)
    kept, seen = tmp_path / "kept.json", []

    def stop(amount: float) -> None:
        seen.append(amount)
        if len(seen) == 3:  # the first call tells what was kept
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        open_loop.study(robot, varied, COUNT, keep=str(kept), advance=stop)
    assert json.loads(kept.read_text())["state"]["jobs"] == 2
    again = []
    assert open_loop.study(robot, varied, COUNT, keep=str(kept), advance=again.append) == whole
    assert again[0] == 2 * open_loop.BLOCK and len(again) == 2
    with pytest.raises(InputError, match="another robot or other options"):
        open_loop.study(robot, varied, COUNT + 1, keep=str(kept))
    kept.write_text("no json")
    with pytest.raises(InputError, match="not the progress"):
        open_loop.study(robot, varied, COUNT, keep=str(kept))


def test_interruption():
    """Jobs that have not begun are dropped."""
    begun, first = [], threading.Event()

    def work(job: int) -> int:
        begun.append(job)
        if job:
            first.wait(10)
        return job

    with pytest.raises(KeyboardInterrupt), workers(None, threads=2) as in_order:
        for _ in in_order(work, range(100)):
            threading.Timer(0.2, first.set).start()
            raise KeyboardInterrupt
    assert len(begun) <= 3


def test_memory():
    """The state is a sum: it does not grow with the configurations."""
    assert sum(total.nbytes for total in open_loop.no_totals(61).values()) < 200_000


@pytest.fixture(scope="module")
def scenario():
    s = scenario_file.load(S2, 3)
    s.trajectory.kind = "polyline"
    s.trajectory.points_mm = [[-18.0, 9.0, 170.0], [-18.0, 39.0, 170.0], [8.0, 39.0, 170.0]]
    return s


def test_closed_loop(robot, varied, whole, scenario):
    """Feedback leaves less than a twentieth of the open-loop error."""
    study = closed_loop.study(robot, varied, scenario, points=3)
    for curve in study.curves:
        assert curve.maximum[1] == 0 and curve.mean[1] == 0  # the nominal robot itself
        if not curve.varied.name.startswith("tracker rotation"):
            opened = next(one for one in whole.influences if one.name == curve.varied.name)
            assert curve.worst_maximum < 0.05 * opened.maximum, curve.varied.name
    assert study.cumulated_maximum == pytest.approx(sum(curve.worst_maximum for curve in study.curves))


def test_dask(robot, varied, whole, scenario):
    """A cluster gives the same numbers."""
    distributed = pytest.importorskip("distributed")
    few = varied[:3]
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        assert open_loop.study(robot, varied, COUNT, dask=address) == whole
        there = closed_loop.study(robot, few, scenario, points=3, dask=address)
    here = closed_loop.study(robot, few, scenario, points=3)
    assert [c.maximum.tolist() for c in there.curves] == [c.maximum.tolist() for c in here.curves]


def test_no_cluster(robot, varied):
    """A scheduler that does not answer is an error with its address."""
    pytest.importorskip("distributed")
    with pytest.raises(InputError, match="no dask scheduler answers at"):
        open_loop.study(robot, varied, 10, dask="not an address")


def test_advice():
    """The advice names the fewest parameters that bring the error below the accuracy."""
    influence = {"length, tube 1": 0.5, "length, tube 3": 0.4, "tracker position x": 0.05, "wall, tube 1": 0.04}
    advice = advise(influence, 0.5)
    assert advice.calibrate == ["length, tube 1"] and advice.error == pytest.approx(0.49)
    assert advise(influence, 0.2, base_mm=0.1).calibrate == ["length, tube 1", "length, tube 3"]
    assert advise(influence, 0.65, independent=True).calibrate == []
    assert "out of reach" in advise(influence, 0.1, base_mm=0.2).text()
    assert grouped(advice.calibrate + ["length, tube 3", "tracker position x"]) == (
        "length of tubes 1 and 3, tracker position x"
    )
    assert grouped(["E, tube 2", "E, tube 3", "E, tube 1", "nu, tube 1"]) == "E of tubes 1, 2 and 3, nu of tube 1"


def test_command(tmp_path):
    """The command writes the report and the JSON, and refuses to study nothing."""
    page, numbers = tmp_path / "page.html", tmp_path / "numbers.json"
    asked = ["sensitivity", str(ROBOT), "--open-loop", "300", "--report", str(page), "--json", str(numbers)]
    done = CliRunner().invoke(cli, asked)
    assert done.exit_code == 0, done.output
    assert "calibrate" in done.output and "evaluations a second and core" in done.output
    data = json.loads(numbers.read_text())["open_loop"]
    assert data["configurations"] == 300 and len(data["influence"]) == 31 and data["calibrate"]
    assert "<svg" in page.read_text()
    nothing = CliRunner().invoke(cli, ["sensitivity", str(ROBOT)])
    assert nothing.exit_code != 0 and isinstance(nothing.exception, InputError)
