"""Scores `ctcr diagnose` on the suite of sets with hidden effects that tools/oracle/make_suite.py writes.

The command runs on robot.yaml and measurements.csv alone; the truth is read afterwards. Answers are kept beside the
suite, so that an interrupted run goes on. Thresholds are set on the sets of the tuning half; the scores to quote are
those of the reporting half.
"""

import argparse
import csv
import json
import math
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from statistics import quantiles

from origin import ROOT, written_by
from ruamel.yaml import YAML

KEPT = ROOT / "docs" / "diagnosis_scores.md"
ABOUT = """Sets with hidden effects from the independent oracle (`tools/oracle`), diagnosed by the command line from
robot file and measurements alone. %s `jitter`: noise of single readings;
`realistic`: with the tracker's smooth field error and outliers too. The floor is that of the true noise, to which
the unequal lags of single readings belong where a delay is hidden.
%s"""
TUNED = "Thresholds were set on the tuning half."
UNSEEN = """Other seeds than those by which thresholds were set, scored once
(`python tools/oracle/make_suite.py --shift K --out FOLDER`)."""
VISIBLE = 30.0  # chi-square after calibration from which a cause can be seen at all (see oracle/detectable.py)

# Causes outside the catalogue that depend on one quantity: how the ids of such quantities begin.
CONVENTIONS = {"grip_slip": "run_offset"}  # causes outside the catalogue that a convention describes, by its kind
DEPENDS = {"rotation_with_translation": "length", "tooth_error": "alpha", "temperature": "time", "grip_slip": "time"}


def wilson(hits: int, count: int) -> str:
    """`hits` of `count` with the 95 % Wilson interval."""
    if not count:
        return "none"
    z, p = 1.96, hits / count
    middle = (p + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count)) / (1 + z * z / count)
    return f"{hits}/{count} = {100 * p:.0f} % ({100 * (middle - half):.0f} to {100 * (middle + half):.0f})"


def answer(folder: Path, answers: Path, seconds: int) -> dict | None:
    """What the command says of a set; None where it fails."""
    target = answers / f"{folder.name}.json"
    if not target.exists():
        command = [sys.executable, "-m", "ctcr", "diagnose", "robot.yaml", "measurements.csv", "--threads", "1"]
        try:
            done = subprocess.run(
                [*command, "--json", str(target)], cwd=folder, capture_output=True, text=True, timeout=seconds
            )
        except subprocess.TimeoutExpired:
            return None
        if done.returncode:
            print(f"{folder.name}: {done.stderr.strip()}", file=sys.stderr)
            return None
    return json.loads(target.read_text())


def judged_varied(said: dict | None, truth: dict) -> list[tuple[str, bool]]:
    """The scores of a set with any robot, any way to measure and any number of causes; one for each cause and name."""
    classes = [set(effect["class"]) for effect in (said or {}).get("effects", [])]
    hidden = [set(cause["ids"]) for cause in truth["causes"] if cause["ids"]]
    seen = [set(cause["ids"]) for cause in truth["causes"] if cause["ids"] and cause["chi_square"] > VISIBLE]
    if said and said["verdict"] == "wrong_convention":  # a frame that far off is to be corrected first
        return [("varied, wrong sheets: a fix only where one is needed", truth["wrong_sheet"])]
    number = ("no cause", "one cause", "two causes", "more")[min(len(seen), 3)]
    scores = [(f"varied, {number}: causes named", any(ids & members for members in classes)) for ids in seen]
    scores += [(f"varied, {number}: names right", any(ids & members for ids in hidden)) for members in classes]
    if not hidden:
        scores.append(("varied: nothing named where nothing is hidden", bool(said) and not classes))
    return scores


def judged(said: dict | None, truth: dict, group: str) -> list[tuple[str, bool]]:
    """Scores for which this set of a group counts, and whether it passes."""
    if group == "varied":
        return judged_varied(said, truth)
    classes, hidden = [effect["class"] for effect in (said or {}).get("effects", [])], truth["classes"]
    word = said["verdict"] if said else "failed"
    found = [any(identity in members for members in classes) for identity in hidden]
    scores = {}
    exact = all(found) and len(classes) == len(hidden)
    unseen = bool(hidden) and truth["chi_square_after_calibration"] < VISIBLE
    if group == "look_alike" and not unseen:  # what calibration takes up is no effect
        scores["look-alikes: their class named, or none where calibration takes both up"] = exact
    if said and not truth.get("wrong_sheet"):
        scores["right data sheets: nothing widened"] = not said.get("widened")
    elif said:
        scores["wrong data sheets: said"] = bool(said.get("widened"))
    if truth["verdict"] == "nothing_missing":
        scores["controls: nothing named"] = word == "nothing_missing"
    elif truth["verdict"] == "not_in_catalogue":
        scores["outside the catalogue: never identified"] = word != "identified"
        [cause] = truth["causes"]
        described = [one["kind"] for one in (said or {}).get("conventions", [])] == [CONVENTIONS.get(cause["name"])]
        scores["outside the catalogue: flagged"] = word in ("not_in_catalogue", "stand_in") or described
        if cause["name"] in DEPENDS:
            named = said["leftover"]["depends_on"] if said else []
            dependence = any(name.startswith(DEPENDS[cause["name"]]) for name in named)
            scores["outside the catalogue: the quantity it depends on named, where it is one"] = dependence
    elif unseen:
        scores["below what the data can show: nothing else named"] = not classes or all(found)
    elif group == "fuller_model":
        scores["forms of a fuller model: named"] = all(found)
        scores["forms of a fuller model: nothing else named"] = len(classes) == sum(found)
    elif hidden:
        scores["right class first"] = bool(classes) and any(identity in classes[0] for identity in hidden)
        scores["exactly the right classes"] = exact
        if len(hidden) > 1:
            scores["pairs: both found"] = all(found)
    if said and hidden and group != "fuller_model":
        limit = 1.1 if truth["noise"] == "jitter" else 1.25
        within = said["rms_mm"].get("with_effects", math.inf) <= limit * floor_mm(truth)
        scores["held-out error within its limit of the noise"] = within
    return [*scores.items()]


def floor_mm(truth: dict) -> float:
    """RMS of the true noise of a set."""
    return math.hypot(*(truth["rms_mm"][part] for part in ("jitter", "field", "chance")))


def held_out_errors(chosen: list[str], said: dict[str, dict | None], truths: dict[str, dict]) -> list[str]:
    """Table of how far above the noise the held-out errors of sets with effects of the catalogue are."""
    rows = []
    for noise in sorted({truths[name]["noise"] for name in chosen}):
        sets = [n for n in chosen if said[n] and truths[n]["classes"] and truths[n]["noise"] == noise]
        for key in ("calibrated", "with_effects"):  # one that stopped at a convention has no effects
            errors = ((said[n]["rms_mm"].get(key), floor_mm(truths[n])) for n in sets)
            values = [error / floor for error, floor in errors if error is not None]
            if len(values) > 1:
                parts = [f"{p:.2f}" for p in quantiles(values, n=20, method="inclusive")]
                rows.append(f"| {key} | {noise} | {parts[9]} | {parts[14]} | {parts[17]} |")
    head = ["| held-out error over the noise | noise | half of the sets | three quarters | nine tenths |"]
    return [*head, "|---|---|---|---|---|", *rows]


def claims(said: dict, truth: dict) -> list[tuple[float, bool]]:
    """Probability and truth of each claim of a diagnosis: each effect that it names, or else its verdict."""
    nothing = not truth["classes"] and truth["verdict"] == "nothing_missing"
    unseen = bool(truth["classes"]) and truth["chi_square_after_calibration"] < VISIBLE
    if said["verdict"] == "nothing_missing":
        return [(said["probability"], nothing or unseen)]
    if said["verdict"] in ("stand_in", "not_in_catalogue"):
        return [(said["probability"], truth["verdict"] == "not_in_catalogue")]
    return [(one["probability"], not set(truth["classes"]).isdisjoint(one["class"])) for one in said["effects"]]


def reliability(made: list[tuple[float, bool]]) -> list[str]:
    """Table of how often claims of a probability are right, and the Brier and the logarithmic score of all."""
    edges = (0.0, 0.5, 0.7, 0.9, 0.97, 0.99, 1.0)
    rows = ["| probability said | claims | mean | right, 95 % Wilson interval |", "|---|---|---|---|"]
    for low, high in pairwise(edges):
        here = [(p, right) for p, right in made if low <= p < high or p == high == 1.0]
        if here:
            mean, right = sum(p for p, _ in here) / len(here), sum(right for _, right in here)
            rows.append(f"| {low:g} to {high:g} | {len(here)} | {mean:.3f} | {wilson(right, len(here))} |")
    brier = sum((p - right) ** 2 for p, right in made) / len(made)
    log = -sum(math.log(max(p if right else 1 - p, 1e-6)) for p, right in made) / len(made)
    return [*rows, "", f"Brier score {brier:.4f}, logarithmic score {log:.4f} (0: perfect)."]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--suite", type=lambda text: Path(text).resolve(), default=ROOT / "build" / "suite")
    parser.add_argument("--half", choices=("tuning", "reporting", "both"), default="reporting")
    parser.add_argument("--every", type=int, default=1, help="score every n-th set only")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=int, default=300, help="longest time for one set")
    parser.add_argument("--keep", action="store_true", help="write the result to docs")
    parser.add_argument("--unseen", action="store_true", help="say that nobody has looked at these seeds")
    options = parser.parse_args()
    if not (options.suite / "truth").is_dir():
        sys.exit(f"{options.suite} holds no suite: python tools/oracle/make_suite.py writes it")
    yaml = YAML(typ="safe")
    truths = {path.stem: yaml.load(path.read_text()) for path in sorted((options.suite / "truth").glob("s*.yaml"))}
    chosen = [name for name, t in truths.items() if options.half in (t["half"], "both")][:: options.every]
    answers = options.suite / "answers"
    answers.mkdir(exist_ok=True)
    with ThreadPoolExecutor(options.jobs) as pool:
        said = dict(
            zip(chosen, pool.map(lambda n: answer(options.suite / n, answers, options.seconds), chosen), strict=True)
        )
    with (options.suite / "truth" / "index.csv").open(encoding="utf-8") as index:
        groups = {row["set"]: row["group"] for row in csv.DictReader(index)}
    text = report(chosen, said, truths, groups)
    print(text)
    if options.keep:
        of = "unseen seeds" if options.unseen else f"the {options.half} half"
        title = f"Scores of `ctcr diagnose`: {len(chosen)} sets of {of}"
        about = ABOUT % (UNSEEN if options.unseen else TUNED, written_by("tools/dev score --keep"))
        target = KEPT.with_stem(f"{KEPT.stem}_unseen") if options.unseen else KEPT
        target.write_text(f"# {title}\n\n{about}\n\n{text}\n", encoding="utf-8")


def report(chosen: list[str], said: dict[str, dict | None], truths: dict[str, dict], groups: dict[str, str]) -> str:
    """Tables of the scores by noise, and of who was taken for whom."""
    hits, counts, confusion = Counter(), Counter(), Counter()
    for name in chosen:
        truth = truths[name]
        for score, passed in judged(said[name], truth, groups[name]):
            hits[score, truth["noise"]] += passed
            counts[score, truth["noise"]] += 1
        named = " + ".join("|".join(e["class"]) for e in (said[name] or {}).get("effects", [])) or "nothing"
        confusion[" + ".join(truth["classes"]) or truth["verdict"], named] += 1
    lines = ["| score | noise | passed, 95 % Wilson interval |", "|---|---|---|"]
    lines += [
        f"| {score} | {noise} | {wilson(hits[score, noise], count)} |"
        for (score, noise), count in sorted(counts.items())
    ]
    lines += ["", *reliability([claim for name in chosen if said[name] for claim in claims(said[name], truths[name])])]
    lines += ["", *held_out_errors(chosen, said, truths)]
    lines += ["", "| sets | hidden | named |", "|---|---|---|"]
    lines += [f"| {count} | {hidden} | {named} |" for (hidden, named), count in sorted(confusion.items())]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
