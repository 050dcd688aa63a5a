"""Arguments of the functions that scripts call: what does not fit the annotation is an error that says what would."""

import inspect
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import wraps
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from types import UnionType
from typing import Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np

from ctcr.errors import ArgumentError, Problem, shown

P = ParamSpec("P")
R = TypeVar("R")

_TAKEN = {int: Integral, float: Real, bool: bool | np.bool_, Path: PathLike}  # for values of these annotations
_WORDS = {"int": "int >= 0", "NoneType": "None"}
_WORDS |= {"Robot": "a Robot (of ctcr.load)", "Measurements": "Measurements (of ctcr.read)"}


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which raises an ArgumentError that names all arguments that do not fit their annotations."""
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError:  # too many, or too few: the function says which, with its name
            return function(*args, **kwargs)
        problems = []
        for name, value in given.items():
            hint = signature.parameters[name].annotation
            if not _fits(value, hint):
                problems.append(Problem(f"needs {_words(hint)}, not {shown(value)}", field=name))
        if problems:
            raise ArgumentError(problems)
        return function(*args, **kwargs)

    return call


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is what an annotation says, as far as that can be told; whole numbers count something."""
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is Literal:
        return isinstance(value, str) and value in parts
    if origin is Sequence:
        several = isinstance(value, Collection) and not isinstance(value, str)
        return several and all(_fits(one, parts[0]) for one in value)
    if origin is Mapping:
        return isinstance(value, Mapping) and all(_fits(x, parts[0]) and _fits(y, parts[1]) for x, y in value.items())
    if origin is Callable:
        return callable(value)
    if origin is np.ndarray:
        return np.ndim(value) > 0
    if not isinstance(hint, type) or hint is inspect.Parameter.empty:
        return True
    if hint in (int, float) and isinstance(value, bool) or hint is int and isinstance(value, Integral) and value < 0:
        return False
    return isinstance(value, _TAKEN.get(hint, hint))


def _words(hint: Any) -> str:
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(map(_words, parts)))
    if origin is Literal:
        return " or ".join(map(repr, parts))
    if origin is Sequence:
        return f"a list of {_words(parts[0])}"
    if origin is Mapping:
        return f"a dict of {_words(parts[1])} by {_words(parts[0])}"
    if origin in (Callable, np.ndarray):
        return "a function" if origin is Callable else "an array"
    return _WORDS.get(hint.__name__, hint.__name__)
