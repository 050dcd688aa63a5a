"""`next`: runs that the robot can do, and the evidence that they promise."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from ctcr import cli
from ctcr.commands import next as next_runs
from ctcr.commands import options
from ctcr.diagnose.verdict import Verdict
from ctcr.model import simulation
from ctcr.plan.proposal import Contest, Proposal, random_runs, table
from ctcr.table import measurements

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def demo(robot):
    return measurements.load(EXAMPLES / "data" / "demo" / "measurements.csv", robot.n_tubes)


def test_evidence():
    """The evidence of a run is that of the marginal distribution of its readings."""
    random = np.random.default_rng(1)
    for _ in range(20):
        J, r = random.normal(size=(24, 5)), random.normal(size=24)
        root = random.normal(size=(5, 5))
        P, run = root @ root.T, np.repeat(np.arange(4), 6)
        contest = Contest(r, J, run, P)
        for runs in ([0], [1, 3], [0, 1, 2, 3]):
            rows = np.isin(run, runs)
            sigma = np.eye(rows.sum()) + J[rows] @ P @ J[rows].T
            assert contest.evidence(runs) == pytest.approx(0.5 * r[rows] @ np.linalg.solve(sigma, r[rows]))


def test_more_runs():
    """Further runs never reduce the evidence."""
    random = np.random.default_rng(2)
    run = np.repeat(np.arange(8), 6)
    contest = Contest(random.normal(size=48), random.normal(size=(48, 5)), run, np.eye(5))
    evidence = [contest.evidence(list(range(count))) for count in range(1, 9)]
    assert all(a <= b for a, b in pairwise(evidence))


def test_random_runs(robot, demo):
    """Runs go out and back through the same stops, within the measured joints and their order."""
    runs = random_runs(robot, demo, 30, np.array([0.0, 0.01]), np.random.default_rng(3))
    assert len(runs) == 30 and {run.mass for run in runs} == {0.0, 0.01}
    lengths = np.array([tube.length for tube in robot.tubes])
    for run in runs:
        for joint, seen in ((run.beta, demo.beta), (run.alpha, demo.alpha)):
            np.testing.assert_array_equal(joint, joint[::-1])
            assert (joint >= seen.min(axis=0)).all() and (joint <= seen.max(axis=0)).all()
        assert (np.diff(run.beta, axis=1) >= np.diff(demo.beta, axis=1).min(axis=0)).all()
        assert (np.diff(run.beta + lengths, axis=1) <= np.diff(demo.beta + lengths, axis=1).max(axis=0)).all()


def test_table(robot, demo, tmp_path):
    """A plan is a table that can be read again."""
    runs = random_runs(robot, demo, 3, np.array([0.02]), np.random.default_rng(4))
    plan = table(robot, runs, first_run=7)
    simulation.write(plan, tmp_path / "plan.csv")
    again = measurements.load(tmp_path / "plan.csv", robot.n_tubes)
    np.testing.assert_allclose(again.alpha, plan.alpha, rtol=1e-11)
    np.testing.assert_allclose(again.force, np.tile(0.02 * np.array(robot.gravity), (len(plan), 1)), atol=1e-12)
    assert list(np.unique(again.run)) == [7, 8, 9]


def test_masses(tmp_path, capsys):
    """Masses must be grams."""
    assert cli.run(["next", "robot.yaml", "table.csv", "--masses", "ten"]) == 2
    assert "grams" in capsys.readouterr().err


@pytest.mark.parametrize("word", ["identified", "nothing_missing", "probable", "stand_in", "not_in_catalogue"])
def test_nothing_to_decide(capsys, word):
    """Without rivals `next` says that nothing is open only where the verdict does, and else what the verdict says."""
    verdict = Verdict(word, 0.6, [], ["The next explanation is another one."])
    next_runs._show(options.Output(), 3, verdict, Proposal([], np.inf, [], [], None))
    said = " ".join(capsys.readouterr().out.split())
    settled = word in ("identified", "nothing_missing")
    assert ("Nothing is open" in said) == settled and (verdict.sentences[0] in said) != settled
    assert f"the verdict on these measurements is {word.replace('_', ' ')}." in said


@pytest.mark.slow
def test_proposed_runs(robot, tmp_path):
    """Without loads, an entry that yields and one that has play look alike; the proposed runs tell them apart."""
    hidden = ["--hide", "entry_compliance=0.8", "--noise", "jitter"]
    random, source = np.random.default_rng(5), tmp_path / "robot.yaml"
    source.write_text((EXAMPLES / "robots" / "table2.yaml").read_text(), encoding="utf-8")
    demo = measurements.load(EXAMPLES / "data" / "demo" / "measurements.csv", robot.n_tubes)
    simulation.write(table(robot, random_runs(robot, demo, 24, np.zeros(1), random)), tmp_path / "first.csv")

    def simulate(plan: str, target: str) -> None:
        assert cli.run(["simulate", str(source), str(tmp_path / plan), *hidden, "-o", str(tmp_path / target)]) == 0

    def diagnose(readings: str) -> dict:
        answer = tmp_path / "answer.json"
        assert cli.run(["diagnose", str(source), str(tmp_path / readings), "--json", str(answer)]) == 0
        return json.loads(answer.read_text())

    simulate("first.csv", "unloaded.csv")
    asked = ["next", str(source), str(tmp_path / "unloaded.csv"), "-o", str(tmp_path / "plan.csv")]
    assert cli.run([*asked, "--json", str(tmp_path / "next.json")]) == 0
    said = json.loads((tmp_path / "next.json").read_text())
    assert {"entry_compliance", "entry_clearance"} <= set(said["rivals"]) and said["decides"]
    simulate("plan.csv", "more.csv")
    rows = (tmp_path / "more.csv").read_text().splitlines()[1:]
    both = (tmp_path / "unloaded.csv").read_text().splitlines()
    (tmp_path / "both.csv").write_text("\n".join([*both, *rows]) + "\n")
    assert diagnose("both.csv")["effects"][0]["class"] == ["entry_compliance"]
