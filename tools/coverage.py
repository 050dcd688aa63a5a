"""How often the 90 % intervals of `ctcr diagnose` hold the truth, on sets of the suite whose cause was named.

Robot parameters where the cause lies outside the tubes, so that it leaves their meaning as it is, and parameters of
effects which the oracle has in the same form: in other forms there is no true value.
Writes docs/interval_coverage.md with --keep.
"""

import argparse
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from ctcr import diagnose
from ctcr.robot import robot_file
from ctcr.table import measurements
from origin import ROOT, written_by
from ruamel.yaml import YAML
from score import wilson

SUITE = ROOT / "build" / "suite"
KEPT = ROOT / "docs" / "interval_coverage.md"
WIDTH = 1.645  # sd: 90 % of a normal distribution
TUBE = {
    "youngs_modulus": ("youngs_modulus_GPa", 1e9),
    "curvature": ("curvature_per_m", 1.0),
    "curved_length": ("curved_length_mm", 1e-3),
    "length": ("length_mm", 1e-3),
}
OUTSIDE = set(
    (
        "backlash_rotation backlash_translation delay tip_load sensor_offset field_distortion frame_drift frame_jump "
        "periodic_rotation periodic_translation entry_compliance contact"
    ).split()
)
EFFECTS = {  # id -> parameters without the id, and their true values
    "delay": lambda v: {"delay": v["delay_s"]},
    "sensor_offset": lambda v: dict(zip("xyz", v["offset_m"], strict=True)),
    "entry_compliance": lambda v: {"compliance": v["compliance_rad_per_Nm"]},
    "backlash_rotation": lambda v: {f"play.{i}": g for i, g in enumerate(v["half_gap"], start=1)},
}


def truth_of(answers: dict[str, Any]) -> dict[str, float]:
    """True values by the name of the parameter, SI."""
    bench = answers["bench"]
    true = {}
    for i, tube in enumerate(bench["tubes"], start=1):
        true |= {f"tubes.{i}.{name}": tube[key] * unit for name, (key, unit) in TUBE.items()}
    for kind, key in (("rotation", "alpha_offset_rad"), ("translation", "beta_offset_m")):
        true |= {f"actuation.home_{kind}.{i}": value for i, value in enumerate(bench[key], start=1)}
    for cause in answers["causes"]:
        for identity in cause["ids"]:
            own = EFFECTS.get(identity, lambda _: {})(cause["values"])
            true |= {f"effects.{identity}.{name}": value for name, value in own.items()}
    return true


def errors(name: str) -> tuple[str, str, list[tuple[str, float]]] | None:
    """Noise, classes, and error in sd of each parameter of a set; None where something else was named."""
    answers = YAML(typ="safe").load((SUITE / "truth" / f"{name}.yaml").read_text())
    robot = robot_file.load(SUITE / name / "robot.yaml")
    table = measurements.load(SUITE / name / "measurements.csv", robot.n_tubes)
    found = diagnose(robot, table, threads=1, anyway=True)
    named = [accepted.ids for accepted in found.accepted]
    if len(named) != len(answers["classes"]) or not all(any(c in ids for ids in named) for c in answers["classes"]):
        return None
    true, fit = truth_of(answers), found.final
    offset = {n: v for n, v in zip(fit.names, fit.prior_mean, strict=True) if n.startswith("actuation.")}
    z = [
        (parameter, float((value - offset.get(parameter, 0.0) - true[parameter]) / sd))
        for parameter, value, sd in zip(fit.names, fit.values, fit.sd, strict=True)
        if parameter in true
    ]
    return answers["noise"], "+".join(answers["classes"]) or "nothing", z


def sets(half: str, every: int) -> list[str]:
    yaml = YAML(typ="safe")
    known = {p.stem: yaml.load(p.read_text()) for p in sorted((SUITE / "truth").glob("*.yaml"))}
    chosen = [
        name
        for name, answers in known.items()
        if answers["half"] == half and all(cause["ids"] and set(cause["ids"]) <= OUTSIDE for cause in answers["causes"])
    ]
    return chosen[::every]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--half", choices=("tuning", "reporting"), default="reporting")
    parser.add_argument("--every", type=int, default=1, metavar="N")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--keep", action="store_true")
    given = parser.parse_args()

    names = sets(given.half, given.every)
    rows: dict[tuple[str, str], list[float]] = defaultdict(list)
    counted = 0
    with ProcessPoolExecutor(given.jobs) as pool:
        for name, answer in zip(names, pool.map(errors, names), strict=True):
            if answer is None:
                print(f"{name}: other effects were named")
                continue
            counted += 1
            noise, classes, z = answer
            within = np.mean(np.abs([error for _, error in z]) <= WIDTH)
            print(f"{name} {noise} {classes}: {within:.0%} of {len(z)}", flush=True)
            for parameter, error in z:
                part = parameter.split(".")
                rows[noise, part[1] if part[0] != "tubes" else part[2]].append(error)
                rows[noise, "all"].append(error)
    table = [
        f"# 90 % intervals of `ctcr diagnose`: {counted} sets of the {given.half} half",
        "",
        "Share of true values within 1.645 posterior standard deviations, by parameter: of the robot, or of an effect",
        "that the independent oracle has in the same form. Sets whose cause lies outside the tubes, or without one,",
        "where the right effects were named.",
        written_by("tools/coverage.py --keep"),
        "",
        "| parameters | noise | within, 95 % Wilson interval | mean square error / variance |",
        "|---|---|---|---|",
    ]
    for (noise, kind), z in sorted(rows.items()):
        hits = int(np.sum(np.abs(z) <= WIDTH))
        table.append(f"| {kind} | {noise} | {wilson(hits, len(z))} | {np.mean(np.square(z)):.2f} |")
    print(*table, sep="\n")
    if given.keep:
        KEPT.write_text("\n".join(table) + "\n")


if __name__ == "__main__":
    main()
