"""Values that are compared, hashed, copied and passed to other processes by their content."""

from __future__ import annotations

import hashlib
from typing import Any, TypeVar

Self = TypeVar("Self", bound="Content")


class Content:
    """A value that never changes: equal to another of the same content, and its own copy.

    joblib, Dask, Ray and dictionaries tell such values apart by their content, in any process.
    """

    def _content(self) -> tuple[Any, ...]:
        """What it is, as bytes, strings, numbers, and tuples of them."""
        raise NotImplementedError

    def _digest(self) -> bytes:
        """Of the content, computed once; the same in every process."""
        found = self.__dict__.get("_digested")
        if found is None:
            hashed = hashlib.blake2b(digest_size=16)
            for part in (type(self).__qualname__, *self._content()):
                part = part if isinstance(part, bytes) else repr(part).encode("utf-8", "surrogatepass")
                hashed.update(b"%d:" % len(part) + part)
            found = self.__dict__["_digested"] = hashed.digest()
        return found

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if type(self) is not type(other):
            return NotImplemented
        return self._digest() == other._digest()  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return int.from_bytes(self._digest()[:8], "little", signed=True)

    def __copy__(self: Self) -> Self:
        return self

    def __deepcopy__(self: Self, memo: Any) -> Self:
        return self

    def __dask_tokenize__(self) -> tuple[str, str]:
        return type(self).__qualname__, self._digest().hex()
