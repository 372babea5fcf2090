"""The real accelerometer recording that several tests use; see authorities/xsens_acc.txt."""

import io
import lzma
from pathlib import Path

import numpy as np

from gimbalcal.number import Array

FILE = Path(__file__).parent / "authorities" / "xsens_acc.npy.xz"


def accelerometers() -> tuple[Array, Array]:
    """Time (n,) s and counts (n, 3)."""
    table = np.cumsum(np.load(io.BytesIO(lzma.decompress(FILE.read_bytes()))), axis=1)
    return table[0] / 1e6, table[1:].T.astype(float)


def as_text(path: Path) -> Path:
    """The file of the toolkit again, as far as its numbers go."""
    time, counts = accelerometers()
    lines = [f"   {t:.6e}   {x:.7e}   {y:.7e}   {z:.7e}" for t, (x, y, z) in zip(time, counts, strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path
