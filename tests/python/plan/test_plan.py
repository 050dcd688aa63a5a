"""`next`: runs that the robot can do, and the evidence that they promise."""

import dataclasses
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from ctcr import cli
from ctcr.commands import next as next_runs
from ctcr.commands import options
from ctcr.diagnose import diagnose
from ctcr.diagnose.explanations import Explanation
from ctcr.diagnose.verdict import Verdict
from ctcr.model import simulation
from ctcr.plan.proposal import Contest, Proposal, propose, random_runs, table
from ctcr.table import measurements
from hidden_sessions import measured

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def demo(robot):
    return measurements.load(EXAMPLES / "data" / "demo" / "measurements.csv", robot.n_tubes)


def contest(random, runs=4):
    """A contest of random predictions by run, with its parts."""
    rows = 6 * runs
    parts = random.normal(size=rows), random.normal(size=(rows, 5)), random.normal(size=(rows, 3))
    run = np.repeat(np.arange(runs), 6)
    return Contest(*parts, run), parts, run


def test_evidence():
    """The evidence is the Kullback-Leibler divergence of two normal distributions of the readings."""
    random = np.random.default_rng(1)
    for _ in range(20):
        made, (r, own, other), run = contest(random)
        for runs in ([0], [1, 3], [0, 1, 2, 3]):
            rows = np.isin(run, runs)
            first, second = (np.eye(rows.sum()) + J[rows] @ J[rows].T for J in (own, other))
            spread = np.trace(np.linalg.solve(second, first)) - rows.sum() + r[rows] @ np.linalg.solve(second, r[rows])
            volume = np.linalg.slogdet(second)[1] - np.linalg.slogdet(first)[1]
            assert made.evidence(runs) == pytest.approx(0.5 * (spread + volume))


def test_same_prediction():
    """Explanations that predict the same, and as surely, gain nothing."""
    r, J = np.zeros(12), np.random.default_rng(2).normal(size=(12, 4))
    assert Contest(r, J, J, np.repeat([0, 1], 6)).evidence([0, 1]) == pytest.approx(0, abs=1e-12)


def test_more_runs():
    """Further runs never reduce the evidence."""
    made, _, _ = contest(np.random.default_rng(2), runs=8)
    evidence = [made.evidence(list(range(count))) for count in range(1, 9)]
    assert all(a <= b for a, b in pairwise(evidence))


def test_one_effect_less(robot):
    """Whether an effect acts at all is a question that runs can answer: each explanation has its own parameters."""
    made = measured(robot, np.random.default_rng(2), {"effects.tip_load.mass": 2e-3})
    found = diagnose(robot, made)
    assert len(found.verdict.likeliest) == 1 and not propose(found).rivals
    explanations = [Explanation(frozenset(ids), False, p) for ids, p in ((["tip_load"], 0.6), ([], 0.4))]
    verdict = Verdict("probable", 0.6, explanations)
    proposal = propose(dataclasses.replace(found, verdict=verdict), runs=2)
    assert list(map(str, proposal.rivals)) == ["tip_load", "noise alone"] and verdict.undecided == ["tip_load"]
    with_it, without = (rival.fit.names for rival in proposal.rivals)
    assert set(with_it) - set(without) == {name for name in with_it if name.startswith("effects.tip_load.")}
    assert proposal.now == pytest.approx(np.log(1.5))
    assert len(proposal.runs) == 2 and 0 < proposal.gain[0] < proposal.gain[1]


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


@pytest.mark.parametrize("outside", [0.0, 0.4])
def test_nothing_to_decide(capsys, outside):
    """Without rivals `next` says that nothing is open only where one explanation is, and else what the verdict says."""
    explanations = [Explanation(frozenset(["friction"]), False, 1 - outside), Explanation(frozenset(), True, outside)]
    verdict = Verdict("stand_in", 0.6, explanations, ["Friction can explain a part."])
    next_runs._show(options.Output(), 3, verdict, Proposal([], [], [], None))
    said = " ".join(capsys.readouterr().out.split())
    assert ("Nothing is open: " in said) == (outside == 0) and (verdict.sentences[0] in said) == (outside > 0)
    assert "the verdict on these measurements is stand in." in said


@pytest.mark.slow
def test_proposed_runs(robot, tmp_path):
    """Without loads, an entry that yields and one that has play look alike; the proposed runs tell them apart."""
    hidden = ["--hide", "entry_compliance=3", "--noise", "jitter"]
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
