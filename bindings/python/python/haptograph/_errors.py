"""Exceptions of the package."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


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
        super().__init__(text)
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
