"""A program: a .mat file on its standard input becomes a .npz file on its standard output."""

import io
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat


def numeric(prefix: str, found: dict[str, Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """The arrays of numbers, those of structs as NAME.FIELD."""
    for name, value in found.items():
        if isinstance(value, dict):
            yield from numeric(f"{prefix}{name}.", value)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            yield prefix + name, value


if __name__ == "__main__":
    try:
        arrays = dict(
            numeric("", loadmat(io.BytesIO(sys.stdin.buffer.read()), simplify_cells=True))
        )
    except Exception as error:  # of any kind, for a damaged file
        raise SystemExit(f"{type(error).__name__}: {error}") from None
    np.savez(sys.stdout.buffer, **arrays)  # type: ignore[arg-type]
