"""What fails, as exceptions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


class Error(ValueError):
    """A call failed; the text says what is wrong and what to do.

    Attributes
    ----------
    code : str
        Of a graph's first error, ``"E0204"``, as docs/diagnostics.md lists them; empty for others.
    span : tuple of int, optional
        The first error's place in its file: first byte, and one past the last.
    help : list of str
        What to do about it, one line each.
    """

    code: str = ""
    span: tuple[int, int] | None = None

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.help: list[str] = []


@dataclass(frozen=True)
class Diagnostic:
    """One thing that is wrong with a graph, or a warning of it.

    Attributes
    ----------
    code : str
        Stable: docs/diagnostics.md lists them.
    severity : str
        ``"error"`` or ``"warning"``.
    message : str
        What is wrong, in a sentence.
    help : list of str
        What to do about it, one line each.
    file, line, column, span
        Where: line and column count from 1, the span in bytes; None where the graph has no text there.
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
    """A graph has errors; the text shows them as the terminal does.

    Attributes
    ----------
    diagnostics : list of Diagnostic
        All of them, warnings too.
    """

    def __init__(self, rendered: str, found: list[dict[str, Any]]) -> None:
        super().__init__(rendered)
        self.diagnostics = [Diagnostic(**one) for one in found]
        errors = [one for one in self.diagnostics if one.severity == "error"]
        if errors:
            self.code, self.span, self.help = errors[0].code, errors[0].span, errors[0].help

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.args[0], [vars(one) for one in self.diagnostics])
