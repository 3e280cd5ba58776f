"""Exceptions of the package."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

# What the command calls its flags, and what a call in Python names instead.
_PAIRS = {"--column": "columns", "--unit": "units", "--constant": "constants"}
_FLAGS = {
    "--sample-rate HZ": "`rate=HZ`",
    "--sample-rate": "`rate=`",
    "--full-scale": "`full_scale=`",
    "--strict": "`strict=True`",
    "--accept-rate": "`accept_rate=True`",
}
# A value is quoted where a column has that name; it may hold anything.
_FLAG = re.compile(
    r"""(--column|--unit|--constant) ([a-z_]+)=("(?:[^"\\]|\\.)*"|[^\s,;()]+)|"""
    + "|".join(map(re.escape, [*_FLAGS, *_PAIRS]))
)


def in_python(text: str) -> str:
    """A message of the library, with keyword arguments in place of the command's flags."""

    def keyword(found: re.Match[str]) -> str:
        flag, name, value = found.groups()
        if flag is None:
            return _FLAGS.get(found.group()) or f"`{_PAIRS[found.group()]}=`"
        quoted = value if value.startswith('"') or flag == "--constant" else f'"{value}"'
        return f'`{_PAIRS[flag]}={{"{name}": {quoted}}}`'

    return _FLAG.sub(keyword, text)


class LearningWarning(UserWarning):
    """What :func:`learn` could not learn, or learned from too little: see :attr:`Surface.warnings`."""


class RangeWarning(UserWarning):
    """Forces or speeds that were changed to what can be rendered: beyond the largest of a surface, or a signed velocity."""


class Error(ValueError):
    """Error of a call; its text states the cause and the remedy.

    Attributes
    ----------
    code : str
        Code of the first error of a graph, ``"E0204"``, from docs/diagnostics.md; empty for other errors.
    span : tuple of int, optional
        Position of the first error in its file: first byte, and one past the last.
    help : list of str
        Remedies, one line each.
    """

    code: str = ""
    span: tuple[int, int] | None = None

    def __init__(self, text: str) -> None:
        super().__init__(in_python(text))
        self.help: list[str] = []


@dataclass(frozen=True)
class Diagnostic:
    """An error or a warning of a graph.

    Attributes
    ----------
    code : str
        Stable code, listed in docs/diagnostics.md.
    severity : str
        ``"error"`` or ``"warning"``.
    message : str
        The error in one sentence.
    help : list of str
        Remedies, one line each.
    file, line, column, span
        Position: line and column count from 1, the span is in bytes; None if the error has no position in a text.
    """

    code: str
    severity: str
    message: str
    help: list[str]
    file: str | None
    line: int | None
    column: int | None
    span: tuple[int, int] | None


class GraphError(Error):
    """Errors of a graph; the text shows them as on the terminal.

    Attributes
    ----------
    diagnostics : list of Diagnostic
        All errors and warnings.
    """

    def __init__(self, rendered: str, found: list[dict[str, Any]]) -> None:
        super().__init__(rendered)
        self.diagnostics = [Diagnostic(**one) for one in found]
        errors = [one for one in self.diagnostics if one.severity == "error"]
        if errors:
            self.code, self.span, self.help = errors[0].code, errors[0].span, errors[0].help

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.args[0], [vars(one) for one in self.diagnostics])
