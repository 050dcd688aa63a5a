"""A robot as a C++ header for a controller: its numbers as constants, and a function that makes the model of them."""

import ctypes
import json
import re
from collections.abc import Iterable, Iterator
from datetime import date
from importlib.metadata import version
from math import isclose
from pathlib import Path

import numpy as np

from ctcr.bench.devices.bench_file import Bench
from ctcr.effects import catalogue
from ctcr.errors import InputError, Problem
from ctcr.inputs import sha256
from ctcr.model import parameters
from ctcr.robot.checks import path_text
from ctcr.robot.description import Robot
from ctcr.robot.ledger import section
from ctcr.show.wording import deviation, number, visible

RATIOS = ("translation_mm_per_rev", "rotation_rev_per_rev")
# Keywords and other spellings of operators of C++20.
KEYWORDS = set(
    """
    alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t char32_t class
    co_await co_return co_yield compl concept const const_cast consteval constexpr constinit continue decltype default
    delete do double dynamic_cast else enum explicit export extern false float for friend goto if inline int long
    mutable namespace new noexcept not not_eq nullptr operator or or_eq private protected public register
    reinterpret_cast requires return short signed sizeof static static_assert static_cast struct switch template this
    thread_local throw true try typedef typeid typename union unsigned using virtual void volatile wchar_t while xor
    xor_eq
    """.split()
)
SAME = 1e-6  # relative: a ledger and a file round the same value to eight digits
SYSTEM = """\
/// The robot with its effects, motors and tracker, ready for a controller; share it between threads.
[[nodiscard]] inline ctcr::System<tube_count, Effects> system() noexcept {{
  using Vector = ctcr::VecN<tube_count>;
  const ctcr::Robot<tube_count> tubes_and_gravity{{tubes, ctcr::Vec3(gravity.data())}};
  const ctcr::Transmission<tube_count> transmission{{
      translation_ratio, rotation_ratio, Vector(home_translation.data()), Vector(home_rotation.data())}};
  const ctcr::PoseSensor sensor{{
      {{ctcr::rotation_matrix(ctcr::Vec3(tracker_rotation.data())), ctcr::Vec3(tracker_position.data())}},
      sensor_tube,
      {{ctcr::rotation_matrix(ctcr::Vec3(sensor_rotation.data())), ctcr::Vec3(sensor_position.data())}}}};
  Effects::On<tube_count> effects;{effects}
  return {{transmission, ctcr::Model<tube_count, Effects>(tubes_and_gravity, effects), sensor}};
}}"""
COPIED = """
  effects.for_each([](auto& effect, int first) {
    std::copy_n(effect_values.begin() + first, effect.count, effect.values.begin());
  });"""


def cpp_header(robot: Robot, namespace: str = "robot", bench: Bench | None = None) -> str:
    """The text of a header that needs ctcr and Eigen alone.

    namespace    of what it declares
    bench        whose limits the header holds; None: the library's usual ones
    Raises InputError where a controller needs what the robot file does not know, and for effects written in Python.
    """
    _check(robot, namespace)
    known = dict(zip(parameters.names_of(robot.n_tubes), parameters.values(robot), strict=True))
    return "\n".join(
        [
            *_opening(robot),
            "// clang-format off",
            "#pragma once",
            "#include <algorithm>",
            "#include <array>",
            "#include <cstddef>",
            "#include <ctcr/control/limits.hpp>",
            "#include <ctcr/ctcr.hpp>",
            *(["#include <ctcr/effects/catalogue.hpp>", "#include <string_view>"] if robot.effects else []),
            "",
            *_no_macros(namespace.split("::")),
            f"namespace {namespace} {{",
            "",
            f"inline constexpr int tube_count = {robot.n_tubes};",
            "",
            *_tubes(robot, known),
            "",
            *_devices(robot, known),
            "",
            *_effects(robot),
            "",
            SYSTEM.format(effects=COPIED if robot.effects else ""),
            "",
            *_limits(robot, bench),
            "",
            f"}}  // namespace {namespace}",
            "",
        ]
    )


def _check(robot: Robot, namespace: str) -> None:
    problems = [
        Problem("is not known: a controller needs it", robot.file or None, field=f"actuation.{field}")
        for field in RATIOS
        if getattr(robot.actuation, field) is None
    ]
    problems += catalogue.in_python(robot)
    if not is_free(namespace.split("::")):
        text = "is no free name in C++, as keywords and those of the C library: use letters, digits and _"
        problems.append(Problem(text, field=f"namespace {visible(namespace)}"))
    if problems:
        raise InputError(problems)


def is_free(names: list[str]) -> bool:
    """Whether a header can declare these nested namespaces, as far as no compiler is needed to say it.

    What the C library defines, headers declare outside of all namespaces.
    """
    word = re.compile(r"[A-Za-z]\w*", re.ASCII)
    free = all(word.fullmatch(name) and name not in KEYWORDS | {"std", "ctcr"} for name in names)
    return free and names[0] != "Eigen" and not hasattr(ctypes.CDLL(None), names[0])


def _no_macros(names: list[str]) -> Iterator[str]:
    """The compiler alone knows which names are macros where the header is included."""
    for name in dict.fromkeys(names):
        yield f"#ifdef {name}"
        yield f'#error "{name} is a macro here: export the robot with another --namespace"'
        yield "#endif"


def _opening(robot: Robot) -> Iterator[str]:
    """The opening comment: the purpose of the header, and the source of its numbers."""
    yield f"// The robot {_quoted(robot.name)}: tubes, homes, frames, effects and limits, and the model of them."
    source = f" from {_quoted(Path(robot.file).name)}" if robot.file else ""
    yield f"// Exported by ctcr {version('ctcr')} on {date.today().isoformat()}{source}: change that, not this header."
    if robot.file:
        yield f"// sha256 of the file: {sha256(robot.file)}"
    yield "// SI units; tubes from the innermost outwards. `sd`: standard deviation of a value that was fitted."


def _tubes(robot: Robot, known: dict[str, float]) -> Iterator[str]:
    yield "inline constexpr std::array<ctcr::Tube, tube_count> tubes{{"
    for i in range(1, robot.n_tubes + 1):
        stem = f"tubes.{i}."
        yield "    {"
        for name, value in known.items():
            if name.startswith(stem):
                yield f"        .{name.removeprefix(stem)} = {_double(value)},{_fitted(robot, name)}"
        yield "    },"
    yield "}};"


def _devices(robot: Robot, known: dict[str, float]) -> Iterator[str]:
    """Gravity, transmission, tracker frame and sensor."""

    def vector(name: str, stem: str, meaning: str) -> Iterator[str]:
        names = [full for full in known if full.startswith(f"{stem}.")]
        yield f"inline constexpr std::array<double, {len(names)}> {name}{{  // {meaning}"
        yield from (f"    {_double(known[full])},{_fitted(robot, full)}" for full in names)
        yield "};"

    def scalar(name: str, full: str, meaning: str) -> str:
        fitted = _fitted(robot, full).replace("  // ", "; ")
        return f"inline constexpr double {name} = {_double(known[full])};  // {meaning}{fitted}"

    unknown = "" if robot.gravity else "; not known: weightless"
    yield from vector("gravity", "gravity", f"base frame [m/s^2]{unknown}")
    yield scalar("translation_ratio", "actuation.translation_ratio", "beta by motor angle [m/rad]")
    yield scalar("rotation_ratio", "actuation.rotation_ratio", "alpha by motor angle [rad/rad]")
    yield from vector("home_translation", "actuation.home_translation", "beta where the motors are at 0 [m]")
    yield from vector("home_rotation", "actuation.home_rotation", "alpha where the motors are at 0 [rad]")
    yield from vector("tracker_position", "tracker.position", "of the base frame in the tracker frame [m]")
    yield from vector("tracker_rotation", "tracker.rotation", "its rotation vector there [rad]")
    tube = robot.tracker.sensor_on_tube - 1
    yield f"inline constexpr int sensor_tube = {tube};  // whose tip carries the sensor, from 0"
    for name, key, text in (
        ("sensor_position", "sensor_position_mm", "of the sensor in the frame of that tip [m]"),
        ("sensor_rotation", "sensor_rotation_vector_rad", "its rotation vector there [rad]"),
    ):
        unknown = "; not known" if getattr(robot.tracker, key) is None else ""
        yield from vector(name, f"tracker.{name}", text + unknown)


def _effects(robot: Robot) -> Iterator[str]:
    if not robot.effects:
        yield "using Effects = ctcr::Standard;  // none beyond the standard model"
        return
    known, order = catalogue.value_of(robot), catalogue.catalogue(robot.n_tubes)
    ids = [identity for identity in order if identity in robot.effects]
    asked = " || ".join(f'id == "{identity}"' for identity in ids)
    yield f"constexpr bool has_effect(std::string_view id) noexcept {{ return {asked}; }}"
    yield "using Effects = ctcr::Catalogue::Those<has_effect>;"
    yield "inline constexpr std::array<double, std::size_t(Effects::On<tube_count>::count)> effect_values{"
    for identity in ids:
        for parameter in order[identity].parameters:
            for name in parameter.full_names:
                unit = f" [{parameter.unit}]" if parameter.unit else ""
                comment = f"{name.removeprefix('effects.')}{unit}{_of_effect(robot, name, known[name])}"
                yield f"    {_double(known[name])},  // {comment}"
    yield "};"


def _limits(robot: Robot, bench: Bench | None) -> Iterator[str]:
    yield "/// What no step of a controller may violate."
    if bench is None:
        yield "/// The library's own: a robot file knows none. `ctcr export --bench FILE` takes those of a bench."
        yield "[[nodiscard]] inline ctcr::Limits<tube_count> limits() noexcept { return {}; }"
        return
    axes, n = bench.axis_settings(robot), robot.n_tubes
    travel = axes.limits.travel + robot.actuation.translation_correction[:, None]
    rotation = axes.limits.rotation + robot.actuation.rotation_correction[:, None]
    yield "/// Those of the bench, without the way that a drive needs to brake. The library's controller holds none of"
    yield "/// rotation: compare alpha with the two below."
    yield "[[nodiscard]] inline ctcr::Limits<tube_count> limits() noexcept {"
    yield "  ctcr::Limits<tube_count> limits;"
    yield f"  limits.base_gap = std::max(limits.base_gap, {_double(axes.limits.clearance)});  // [m]"
    yield f"  limits.translation_speed = {_double(axes.speeds[0])};  // [m/s]"
    yield f"  limits.rotation_speed = {_double(axes.speeds[n])};  // [rad/s]"
    for name, values in zip(("beta_low", "beta_high"), travel.T, strict=True):
        yield f"  limits.{name} << {', '.join(map(_double, values))};  // [m]"
    yield "  return limits;"
    yield "}"
    yield _array("rotation_low", rotation[:, 0]) + "  // of alpha [rad]"
    yield _array("rotation_high", rotation[:, 1]) + "  // of alpha [rad]"


def _fitted(robot: Robot, name: str) -> str:
    """A comment on a parameter that a fit found, with its standard deviation in the unit of the file; else empty."""
    said = _in_ledger(robot, name)
    return f"  // {said}" if said else ""


def _in_ledger(robot: Robot, name: str) -> str:
    """How the ledger came to the value that a parameter has; empty where it does not say."""
    path, unit = parameters.written_at(name)
    if path is None:
        return ""
    value = parameters.value_at(robot, path)
    for entry in reversed(robot.history):
        for row in _rows(entry.get("changes")):
            if row.get("field") in (path_text(path), path_text(path[:-1])):  # a list may have been written as one
                new, sd = (_item(row.get(key), path[-1]) for key in ("new", "sd"))
                same = isinstance(value, int | float) and _is_same(new, value)
                return _said(entry, value, sd, unit) if same else ""
    return ""


def _of_effect(robot: Robot, name: str, value: float) -> str:
    """How the ledger came to the value of a parameter of an effect, in SI units there; empty where it does not say."""
    for entry in reversed(robot.history):
        if one := section(entry, "figures", "parameters", name):
            said = _said(entry, value, one.get("sd"), "") if _is_same(one.get("value"), value) else ""
            return f", {said}" if said else ""
    return ""


def _said(entry: dict, value: float, sd: object, unit: str) -> str:
    known = isinstance(sd, int | float)
    text = f"{number(value, sd) if known else f'{value:.6g}'}{f' {unit}' if unit else ''}"
    text += f", sd {deviation(sd)}" if known else ""
    return _comment(f"{text} ({entry.get('command', '')}, {entry.get('date', '')})")


def _rows(changes: object) -> Iterable[dict]:
    """Entries of a ledger, which may have been edited by hand."""
    return [row for row in changes if isinstance(row, dict)] if isinstance(changes, list) else []


def _item(value: object, index: object) -> object:
    """The number of a list; a number alone is that of a row for each."""
    return value[index] if isinstance(value, list) and isinstance(index, int) and index < len(value) else value


def _is_same(noted: object, value: float) -> bool:
    return isinstance(noted, int | float) and isclose(noted, value, rel_tol=SAME)


def _array(name: str, values: Iterable[float]) -> str:
    return f"inline constexpr std::array<double, {len(np.array(values))}> {name}{{{', '.join(map(_double, values))}}};"


def _double(value: float) -> str:
    """The number to the 15 digits that any double has: a change of units leaves no others."""
    return repr(float(f"{value:.15g}"))


def _quoted(text: str) -> str:
    return _comment(json.dumps(text, ensure_ascii=False))


def _comment(text: str) -> str:
    """Text of a user's that can neither end a comment nor continue it on the next line."""
    return visible(text).rstrip("\\ ")
