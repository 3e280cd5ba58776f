"""Data sets: many vibrations of many surfaces, rendered from a plan."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from . import _native
from ._arrays import items, path_name, whole
from ._errors import Error


@dataclass(frozen=True)
class Rendered:
    """What :func:`batch` did.

    Attributes
    ----------
    chunks : int
        Chunks of the part that was asked for.
    rendered, kept : int
        Of these, rendered now, and there already.
    replaced : list of path
        Files that were not the chunk that they should be; they were rendered again.
    complete : bool
        Whether every chunk of the whole data set is in the folder.
    """

    chunks: int
    rendered: int
    kept: int
    replaced: list[os.PathLike[str]]
    complete: bool


def batch(
    plan: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    shard: tuple[int, int] | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Rendered:
    """Render a data set, as ``haptograph batch`` does: what is missing or broken in the folder, and nothing else.

    Parameters
    ----------
    plan : path
        The plan's file.
    folder : path
        Where the chunks go.
    shard : (int, int), optional
        ``(k, n)`` renders part k, from 1, of n.
    threads : int, optional
        Chunks that are rendered at a time; all cores where it is not given.
    progress : callable, optional
        Called with the part done, 0 to 1. Ctrl-C, or what it raises, ends the call where a further one goes on.
    """
    if shard is not None:
        try:
            number, of = shard
        except (TypeError, ValueError):
            raise Error(f"`shard` is {shard!r}: give (k, n)") from None
        shard = (whole("shard", number, 1), whole("shard", of, 1))
    threads = None if threads is None else whole("threads", threads, 1, 1024)
    return Rendered(**_native.batch(path_name("plan", plan), path_name("folder", folder), shard, threads, progress))


def merge(
    parts: Sequence[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    progress: Callable[[float], object] | None = None,
) -> tuple[int, int]:
    """Make one folder of the parts of a data set: to the bit what one call of :func:`batch` would have left.

    Parameters
    ----------
    parts : sequence of path
        The folders of all parts.
    folder : path
        Where the chunks go.
    progress : callable, optional
        Called with the part done, 0 to 1. Ctrl-C, or what it raises, ends the call where a further one goes on.

    Returns
    -------
    (int, int)
        How many chunks and jobs it has.
    """
    return _native.merge(
        [path_name("parts", part) for part in items("parts", parts)], path_name("folder", folder), progress
    )
