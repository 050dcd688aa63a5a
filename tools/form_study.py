"""How much of what a fuller model does at the tip the forms of the catalogue explain, with everything else known.

Each cause of the oracle (tools/oracle/hidden*.py) acts with physics of its own: tubes with centre lines of their own
in each other's bores, yielding fibres, minimised dissipation. An effect of the catalogue is fitted to noise-free
readings on the very robot, alone and together with the calibration, once by each of its constitutive laws; the best one
counts. Of friction, the limit of the torque between two tubes is compared as well with what their contact forces allow.
Writes docs/effect_forms.md with --keep.
"""

import argparse
import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from statistics import median

for _threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # the matrices are too small for more
    os.environ.setdefault(_threads, "1")

import numpy as np  # noqa: E402
from origin import ROOT, written_by  # noqa: E402

sys.path.insert(0, str(ROOT / "tools" / "oracle"))

KEPT = ROOT / "docs" / "effect_forms.md"
# cause, catalogue's effect, what the fuller model does
FORMS = (
    ("loose_bores", "clearance", "tubes with own centre lines, the gaps of the data sheet"),
    ("loose_bores:0.1", "clearance", "the same, a tenth of the gaps"),
    ("clearance", "clearance", "a hinge at the end of the outer tube that is free within a gap"),
    ("entry_clearance", "entry_clearance", "a hinge behind the plate that is free within a gap"),
    ("entry_compliance", "entry_compliance", "a spring hinge behind the plate"),
    ("friction", "friction", "minimised stored and dissipated energy over small moves"),
    ("softening", "softening", "fibres that yield, integrated over the section"),
    ("anisotropy", "anisotropy", "an elliptic section"),
    ("precurvature_profile", "precurvature_profile", "a cubic spline with random knots"),
    ("helical_precurvature", "helical_precurvature", "a plane that turns unevenly"),
    ("straight_curvature", "straight_curvature", "a wavy coil set, out of plane"),
    ("creep", "creep", "relaxation times from a fiftieth of the session to two and a half of it"),
    ("drive_compliance", "torsional_compliance", "a drive that stiffens with torque"),
    ("shear_stiffness", "torsional_compliance", "another shear modulus"),
    ("backlash_rotation", "backlash_rotation", "play with unequal sides"),
)
SEEDS = range(4)
CONFIGURATIONS = 40  # for the limits of friction

ABOUT = f"""# How well the forms of the effects follow fuller models

{len(SEEDS)} sessions a form: random joints of four robots with two to four tubes, loads of 0, 10 and 20 g. The robot
file is exact and the readings are free of noise, so all that is left is the error of the form. Explained: the part of
the variance of the signal at the tip that the fitted effect takes away; 99 % leave a tenth of the amplitude, 90 % a
third. A calibration absorbs a large part of the signal, but less of the error of the form: of what it leaves, the
effect may explain less."""
EXPLAINED = """
| effect | the fuller model | signal [mm RMS] | explained [%], median | least [%] \
| after calibration [mm RMS] | explained [%], median | least [%] | laws chosen |
|---|---|---|---|---|---|---|---|---|"""
OF_FRICTION = f"""
## The limit of friction

The catalogue limits the torque between two tubes by a coefficient times the jumps of the bending moment M. In a bore
the limit is Coulomb's coefficient times the radius times the contact forces, which are about `M / l` with
`l = sqrt(12 gap / (c M))` (see `include/ctcr/effects/clearance.hpp`): they grow as M to the power of 1.5 and fall with
the root of the gap. So the catalogue's coefficient belongs to a pair of tubes, not to a material, and is a twentieth to
a sixth of Coulomb's. {CONFIGURATIONS} random configurations each:

| robot | gaps | tubes | coefficient / Coulomb's | explained [%] |
|---|---|---|---|---|"""


@dataclass(frozen=True)
class Explained:
    """Of one robot and session: the signal at the tip, and the part of its variance that the form explains; the same of
    what a calibration leaves of it."""

    form: str
    signal_mm: float
    share: float
    calibrated_mm: float
    share_calibrated: float
    law: float | None  # where the effect has several


def explained(form: tuple[str, str, str], seed: int) -> Explained:
    """A robot of the seed whose file is true, moved through a session."""
    from benches import ROBOTS, describe, joint_range
    from ctcr.effects import catalogue
    from ctcr.fit import joint
    from ctcr.model.noise import noise_of
    from ctcr.robot import robot_file
    from ctcr.robot.description import Robot
    from ctcr.table import measurements
    from hidden import hide
    from mechanics import Mechanics
    from robot import from_description
    from scipy.spatial.transform import Rotation
    from session import Habit, Setup, draw_plan, run_session
    from simulate import Bench
    from tables import pose_fields, write_robot, write_table

    (cause, identity, _), robot = form, ROBOTS[seed % len(ROBOTS)]
    cause, _, size = cause.partition(":")
    description, n = describe(robot), len(describe(robot)["tubes"])
    tracker = description["tracker"]
    turn = Rotation.from_rotvec(tracker["rotation_vector_rad"])
    bench = Bench(description, np.zeros(n), np.zeros(n), 1e-3 * np.array(tracker["position_mm"]), turn)
    plan = draw_plan(joint_range(description), np.random.default_rng([41, seed]), Habit())
    setup, plain = (Setup(bench, plan, Mechanics(from_description(description))) for _ in range(2))
    hide(setup, cause, float(size or 1), np.random.default_rng([43, seed]))
    poses, without = list(run_session(setup)), list(run_session(plain))
    signal = np.array([a[0] - b[0] for a, b in zip(poses, without, strict=True)])

    folder = ROOT / "build" / "form_study" / f"{form[0].replace(':', '_')}_{seed}"
    force = plan.mass[:, None] * np.array(description["gravity"])
    leading = zip(plan.time, plan.run, plan.joints, force, poses, strict=True)
    rows = [
        [t, run, *q, *load, *pose_fields(place, turned.as_matrix())] for t, run, q, load, (place, turned) in leading
    ]
    write_robot(folder / "robot.yaml", description)
    write_table(folder / "measurements.csv", rows, n, ("force",), ("t_s", "run"))
    nominal, table = robot_file.load(folder / "robot.yaml"), measurements.load(folder / "measurements.csv", n)

    effect, fits = catalogue.get(identity, n), []
    own = [*effect.amplitudes, *effect.shapes]
    options = {"noise": noise_of(nominal, field=False), "weights": np.ones((len(table), 2)), "scales": {}}

    def left(of: Robot, *free: str) -> float:
        return float(np.sum(joint.fit(of, table, free, **options).residual[:, :3] ** 2))

    for start in ({}, *effect.starts):
        values = {f"effects.{identity}.{name}": x for name, x in start.items()}
        with_effect = catalogue.with_values(nominal, [identity], values)
        law = start.get("law", 0.0) if effect.laws else None
        fits.append((left(with_effect, *own), left(with_effect, "standard", *own), law))
    total, calibrated = float(np.sum(signal**2)), left(nominal, "standard")
    alone, _, law = min(fits, key=lambda one: one[0])
    beside = min(one[1] for one in fits)
    return Explained(
        form[0],
        float(1e3 * np.sqrt(total / len(signal))),
        1 - alone / total,
        float(1e3 * np.sqrt(calibrated / len(signal))),
        1 - beside / calibrated,
        law,
    )


def friction_limits(robot: str, scale: float) -> Iterator[tuple[int, float, float]]:
    """Pair of tubes, coefficient of the catalogue over Coulomb's, and the part of the limit's variance explained."""
    import bore
    from benches import describe, joint_range
    from energy import Energy
    from equilibrium import minimise
    from grid import make_grid
    from robot import from_description
    from session import MASSES

    description, random = describe(robot), np.random.default_rng(5)
    bench, allowed = from_description(description), joint_range(description)
    n, lumped, contact = len(bench.tubes), defaultdict(list), defaultdict(list)
    for k in range(CONFIGURATIONS):
        beta, alpha = np.split(allowed.draw(random), 2)
        force = MASSES[k % len(MASSES)] * bench.gravity
        here = bore.loose(bench, beta, alpha, force, scale * bore.radial_gaps(bench))
        x, grid = bore.settle(here), make_grid(bench, beta, bore.ELEMENT_LENGTH)
        energy, fitting = bore.LooseEnergy(here, bore.CONTACT_STIFFNESS[-1]), Energy(bench, grid, beta, alpha, force)
        settled = minimise(fitting, fitting.initial_guess())
        moment = np.zeros((n, grid.n_elements + 2, 2))  # behind the plate, elements, beyond the tip
        for i, tube in enumerate(bench.tubes):
            moment[i, 1 : 1 + grid.tip_node[i]] = fitting.bending_moment(settled, i, tube.bending_stiffness)
        jump = np.linalg.norm(np.diff(np.cumsum(moment, axis=0), axis=1), axis=2)
        for pair in range(n - 1):
            ends = [*grid.tip_node, *grid.curved_node]
            places = {0} | {int(node) for node in ends if node <= grid.tip_node[pair + 1]}
            lumped[pair].append(sum(jump[pair, node] for node in places))
            radius = 0.5 * bench.tubes[pair].outer_diameter
            contact[pair].append(radius * float(np.sum(energy.contact_force(x, pair))))
    for pair in lumped:
        a, b = np.array(lumped[pair]), np.array(contact[pair])
        coefficient = (a @ b) / (a @ a)
        yield pair, coefficient, 1 - np.sum((b - coefficient * a) ** 2) / np.sum(b**2)


def page(found: list[Explained], limits: list[tuple[str, float, int, float, float]]) -> str:
    """As Markdown."""
    by_form = {form[0]: [one for one in found if one.form == form[0]] for form in FORMS}
    lines = [ABOUT, written_by("tools/form_study.py --keep"), EXPLAINED]
    for name, identity, physics in FORMS:
        mine = by_form[name]
        if not mine:
            continue
        laws = ", ".join(f"{law:.0f}" for law in sorted({one.law for one in mine if one.law is not None}))
        cells = [identity, physics]
        for signals, shares in (
            ([one.signal_mm for one in mine], [one.share for one in mine]),
            ([one.calibrated_mm for one in mine], [one.share_calibrated for one in mine]),
        ):
            cells += [f"{median(signals):.2f}", f"{100 * median(shares):.1f}", f"{100 * min(shares):.1f}"]
        lines.append(f"| {' | '.join([*cells, laws])} |")
    lines.append(OF_FRICTION)
    for robot, scale, pair, coefficient, share in limits:
        lines.append(f"| {robot} | x {scale:g} | {pair + 1} in {pair + 2} | {coefficient:.3f} | {100 * share:.0f} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--form", action="append", help="a cause of the oracle; all by default")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--keep", action="store_true")
    given = parser.parse_args()
    from benches import ROBOTS

    forms, found = [form for form in FORMS if not given.form or form[0] in given.form], []
    with ProcessPoolExecutor(given.jobs) as pool:
        jobs = [pool.submit(explained, form, seed) for form in forms for seed in SEEDS]
        for job in jobs:
            found.append(job.result())
            print(found[-1], flush=True)
    limits = []
    if not given.form:
        limits = [
            (robot, scale, *one) for robot in ROBOTS for scale in (1.0, 0.3) for one in friction_limits(robot, scale)
        ]
    text = page(found, limits)
    print(text)
    if given.keep:
        KEPT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
