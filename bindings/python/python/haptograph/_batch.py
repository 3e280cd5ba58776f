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
    """The result of :func:`batch`.

    Attributes
    ----------
    chunks : int
        Number of chunks of the requested part.
    rendered, kept : int
        Numbers of these chunks that were rendered now, and that existed already.
    replaced : list of path
        Files that did not hold their chunk; they were rendered again.
    complete : bool
        Whether every chunk of the whole data set is in the folder; :func:`open` reads it.
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
    """Render the chunks of a data set that are missing or damaged in the folder, as ``haptograph batch`` does.

    Parameters
    ----------
    plan : path
        The plan's file.
    folder : path
        Folder for the chunks.
    shard : (int, int), optional
        ``(k, n)`` renders part k, from 1, of n.
    threads : int, optional
        Number of chunks rendered at a time; by default one for each core.
    progress : callable, optional
        Called with the fraction done, 0 to 1. Ctrl-C, or an exception that it raises, ends the call; a later call
        continues there.
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
    any_processor: bool = False,
) -> tuple[int, int]:
    """Merge the parts of a data set into one folder, identical to that of one call of :func:`batch`.

    Parameters
    ----------
    parts : sequence of path
        The folders of all parts.
    folder : path
        Folder for the chunks.
    progress : callable, optional
        Called with the fraction done, 0 to 1. Ctrl-C, or an exception that it raises, ends the call; a later call
        continues there.
    any_processor : bool, optional
        Accept parts that were rendered by processors of different families, which may round differently; the manifest
        lists them.

    Returns
    -------
    (int, int)
        Numbers of chunks and jobs of the data set.
    """
    paths = [path_name("parts", part) for part in items("parts", parts)]
    return _native.merge(paths, path_name("folder", folder), bool(any_processor), progress)
