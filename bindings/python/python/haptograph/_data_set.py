"""Data sets on disk: their jobs, labels and chunks."""

from __future__ import annotations

import bisect
import json
import os
import struct
import threading
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from . import _native
from ._arrays import path_name, whole
from ._content import Content
from ._errors import Error

# Chunks of which the files stay open, or mapped, for single items.
_KEPT = 32


class DataSet(Content, Sequence):
    """A data set, or a part of one, in a folder: a sequence of jobs, each read from its file when it is asked for.

    A job is a dictionary of its signals and labels, with the names of docs/batch.md: arrays of its samples as they are
    stored, numbers, and the names of its surface and its motion (``surface_name``, ``motion_name``). A pickle has the
    name of the folder.

    Attributes
    ----------
    folder : path
        The folder.
    manifest : dict
        The content of its ``manifest.json``.
    chunks : list of path
        The files of its chunks.
    surfaces, motions : list of str
        Names by number.
    complete : bool
        Whether every chunk of the whole data set is in the folder.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(path_name("folder", folder)).absolute()
        self.manifest: dict[str, Any] = json.loads(_native.manifest(str(self.folder)))
        self.chunks = [self.folder / chunk["file"] for chunk in self.manifest["chunks"]]
        self.surfaces: list[str] = self.manifest["surfaces"]
        self.motions: list[str] = self.manifest["motions"]
        self.complete: bool = self.manifest["complete"]
        # The position of the first job of each chunk, and of the one after the last.
        self._starts = np.cumsum([0, *(chunk["jobs"][1] - chunk["jobs"][0] for chunk in self.manifest["chunks"])]).tolist()
        self._open: dict[int, _Arrays | _Table] = {}
        self._labels: dict[str, np.ndarray] | None = None

    def __reduce__(self) -> Any:
        return DataSet, (str(self.folder),)

    def _content(self) -> tuple[Any, ...]:
        return (json.dumps(self.manifest, sort_keys=True),)

    def __len__(self) -> int:
        return self._starts[-1]

    def __getitem__(self, key: Any) -> Any:
        """A job by its position, or a list of those of a slice."""
        if isinstance(key, slice):
            return [self[at] for at in range(*key.indices(len(self)))]
        at = key + len(self) if isinstance(key, (int, np.integer)) and key < 0 else key
        if isinstance(at, (int, np.integer)) and not 0 <= at < len(self):
            raise IndexError(f"the data set has {len(self)} jobs, and none at {key}")
        at = whole("key", at)
        number = bisect.bisect_right(self._starts, at) - 1
        with _reading(self.chunks[number]):
            return self._named(self._chunk(number).row(at - self._starts[number]))

    def chunk(self, number: int) -> dict[str, np.ndarray]:
        """The columns of a chunk, by its position in :attr:`chunks`.

        Signals have a row for each job; shorter ones are followed by zeros.
        """
        number = whole("number", number, 0, len(self.chunks) - 1)
        with _reading(self.chunks[number]):
            chunk = self._chunk(number)
            return self._named({name: chunk.column(name) for name in chunk.names})

    @property
    def labels(self) -> dict[str, np.ndarray]:
        """The labels of all jobs: a table of arrays by name, as ``pandas.DataFrame`` takes it. No signal is read."""
        if self._labels is None:
            parts: list[dict[str, np.ndarray]] = []
            for number, path in enumerate(self.chunks):
                with _reading(path):
                    chunk = self._chunk(number)
                    names = [name for name in chunk.names if name not in self.manifest["signals"]]
                    parts.append(self._named({name: chunk.column(name) for name in names}))
            self._labels = {name: np.concatenate([part[name] for part in parts]) for name in (parts[0] if parts else ())}
        return dict(self._labels)

    def __repr__(self) -> str:
        part = "" if self.complete else ", a part of the whole"
        return f"DataSet({str(self.folder)!r}: {len(self)} jobs in {len(self.chunks)} chunks{part})"

    def _chunk(self, number: int) -> Any:
        if number not in self._open:
            if len(self._open) >= _KEPT:
                self._open.pop(next(iter(self._open)), None)
            count = self._starts[number + 1] - self._starts[number]
            reader = _Table if self.manifest["format"] == "Parquet" else _Arrays
            self._open[number] = reader(self.chunks[number], count, self.manifest["signals"])
        return self._open[number]

    def _named(self, columns: dict[str, Any]) -> dict[str, Any]:
        """The same with the names of surfaces and motions."""
        named = {}
        for name, column in columns.items():
            named[name] = column
            if name in ("surface", "motion"):
                names = np.array(self.surfaces if name == "surface" else self.motions)
                named[f"{name}_name"] = names[column] if isinstance(column, np.ndarray) else str(names[column])
        return named


def open(folder: str | os.PathLike[str]) -> DataSet:
    """Open a data set that :func:`batch` rendered, or a part of one, in either format.

    Parameters
    ----------
    folder : path
        The folder with its ``manifest.json``. Parquet needs the package pyarrow.
    """
    return DataSet(folder)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turns what a missing or damaged chunk raises into an error with its remedy."""
    try:
        yield
    except (Error, MemoryError):
        raise
    except Exception as error:
        raise Error(f"{path} is missing or damaged ({error}): render the plan into the folder again") from None


class _Arrays:
    """A chunk of arrays, which stay in the file: only what is asked for is read."""

    def __init__(self, path: Path, count: int, signals: list[str]) -> None:
        self._signals, self._arrays = signals, {}
        with zipfile.ZipFile(path) as archive, path.open("rb") as file:
            for member in archive.infolist():
                if not member.filename.endswith(".npy"):
                    continue
                # A local header is 30 bytes, a name and a filling.
                file.seek(member.header_offset + 26)
                file.seek(sum(struct.unpack("<HH", file.read(4))), os.SEEK_CUR)
                if np.lib.format.read_magic(file) != (1, 0) or member.compress_type != zipfile.ZIP_STORED:
                    raise ValueError(f"{member.filename} is no plain array")
                shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
                if dtype.kind not in "iuf" or is_fortran or shape[:1] != (count,):
                    raise ValueError(f"{member.filename} has type {dtype} and shape {shape}")
                array = np.memmap(path, dtype, "r", file.tell(), shape) if 0 not in shape else np.empty(shape, dtype)
                self._arrays[member.filename[:-4]] = array.view(np.ndarray)
        self.names = list(self._arrays)

    def column(self, name: str) -> np.ndarray:
        return np.array(self._arrays[name])

    def row(self, at: int) -> dict[str, Any]:
        samples = int(self._arrays["samples"][at])
        own = {name: array[at] for name, array in self._arrays.items()}
        return {name: value[:samples].copy() if name in self._signals else value.item() for name, value in own.items()}


class _Table:
    """A chunk in Parquet, read a group of rows at a time."""

    def __init__(self, path: Path, count: int, signals: list[str]) -> None:
        try:
            from pyarrow import parquet
        except ImportError:
            raise Error("this data set is in Parquet, which pyarrow reads: pip install pyarrow") from None
        self._signals, self._file = signals, parquet.ParquetFile(path)
        groups = self._file.metadata
        self._starts = np.cumsum([0, *(groups.row_group(at).num_rows for at in range(groups.num_row_groups))]).tolist()
        if self._starts[-1] != count:
            raise ValueError(f"it has {self._starts[-1]} rows, not {count}")
        self.names = [name for name in self._file.schema_arrow.names if not name.endswith("_name")]
        # The group of rows that was read last, and its number. Arrow's own threads would not outlive a fork.
        self._group: tuple[int, Any] = -1, None
        self._lock = threading.Lock()

    def column(self, name: str) -> np.ndarray:
        with self._lock:
            column = self._file.read([name], use_threads=False).column(name).combine_chunks()
        if name not in self._signals:
            return np.array(column)
        starts, samples = column.offsets.to_numpy(), column.values.to_numpy()
        lengths = np.diff(starts)
        padded = np.zeros((len(column), lengths.max(initial=0)), samples.dtype)
        padded[np.arange(padded.shape[1]) < lengths[:, None]] = samples[starts[0] : starts[-1]]
        return padded

    def row(self, at: int) -> dict[str, Any]:
        number = bisect.bisect_right(self._starts, at) - 1
        with self._lock:
            if self._group[0] != number:
                self._group = number, self._file.read_row_group(number, self.names, use_threads=False)
            group = self._group[1]
        own = {name: group.column(name)[at - self._starts[number]] for name in self.names}
        return {name: np.array(value.values) if name in self._signals else value.as_py() for name, value in own.items()}
