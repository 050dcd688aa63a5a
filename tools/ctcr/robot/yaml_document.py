"""YAML 1.2 read safely, with the line of every field."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.nodes import MappingNode, Node, SequenceNode

from ctcr import inputs
from ctcr.errors import InputError, Problem

FieldPath = tuple[str | int, ...]
MAX_BYTES = 1 << 20  # a description is a few kB: a larger file is something else, often a table


@dataclass(frozen=True)
class YamlDocument:
    """`data` holds plain dictionaries, lists and scalars; `root` the nodes they came from."""

    file: str
    text: str
    data: Any
    root: Node | None

    def line(self, path: FieldPath) -> int | None:
        """Line (from 1) of the field at `path`, or of the nearest enclosing part that exists."""
        node, line = self.root, None
        for step in path:
            key, node = _child(node, step)
            if node is None:
                break
            line = (key or node).start_mark.line + 1
        return line


def load(path: str | Path) -> YamlDocument:
    """The document of a file. Raises InputError where it cannot be read or is no YAML."""
    return parse(inputs.read(path, "this is not a description", MAX_BYTES), str(path))


def parse(content: str | bytes, file: str) -> YamlDocument:
    """Parses one document; `file` is its name in errors. Raises InputError that names the line."""
    try:
        text = content.decode("utf-8-sig") if isinstance(content, bytes) else content
    except UnicodeDecodeError as error:
        line = 1 + content[: error.start].count(b"\n")
        raise InputError(Problem("is not text in UTF-8: save it as that", file, line)) from None
    if not text.strip():
        raise InputError(Problem("is empty", file))
    yaml = YAML(typ="safe", pure=True)
    try:
        root = yaml.compose(text)
        data = None if root is None else yaml.constructor.construct_document(root)
        return YamlDocument(file, text, data, root)
    except MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else None
        hint = ": indent by spaces, not by tabs" if "'\\t'" in str(error.problem) else ""
        raise InputError(Problem(f"not valid YAML: {error.problem or error.context}{hint}", file, line)) from None
    except RecursionError:
        raise InputError(Problem("not valid YAML: nested too deeply", file)) from None
    except Exception as error:  # the YAML library leaks all kinds of exceptions on garbage
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(Problem(f"not valid YAML: {reason}", file)) from None


def _child(node: Node | None, step: str | int) -> tuple[Node | None, Node | None]:
    if isinstance(node, MappingNode):
        return next(((key, value) for key, value in node.value if key.value == step), (None, None))
    if isinstance(node, SequenceNode) and isinstance(step, int) and step < len(node.value):
        return None, node.value[step]
    return None, None
