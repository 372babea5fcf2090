r"""One sigma of each row, as a weight: a row counts as many as it stands for rows of the typical sigma.

.. math:: w_i = w_i^{\rm logged} \, (\sigma_0 / \sigma_i)^2

sigma_0, the median, is then the noise of one sample, as if `[noise]` had stated it, and whatever weighs rows by how
many samples they are the mean of (dwell means, the norm of gravity, setting errors, stars) weighs them by their sigma.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np

from gimbalcal.checks.dropouts import Dropouts
from gimbalcal.errors import InputError
from gimbalcal.recording.columns import Column
from gimbalcal.recording.header import Header
from gimbalcal.recording.record import SENSOR_OF
from gimbalcal.recording.samples import Batch
from gimbalcal.units import is_raw, to_si

WEIGHT = Column(" weight", "weight", "", "1")  # a name that no header can hold


def by_sigma(header: Header, stream: Iterable[Batch], dropouts: Dropouts) -> tuple[Header, Iterator[Batch]]:
    """Return the header and rows with a weight in place of a sigma column, if there is one.

    Raises InputError for a sigma that is not positive, of a quantity without columns, or stated in [noise] too.
    """
    column = header.column("sigma")
    if column is None:
        return header, iter(stream)
    place, sensor = f"{header.path}, column {column.name}", _sensor_of_quantity(column.of)
    if not header.kind.weighed:
        raise InputError(f"{place}: the rows of a {header.kind} recording all weigh alike; leave the sigma out")
    if not header.column(column.of):
        raise InputError(f"{place}: it is the sigma of {column.of}, which no column holds; correct of = ...")
    if sensor in header.noise:
        raise InputError(f"{place}: [noise] states the {sensor} too; leave one of the two out")
    rows = iter(stream)
    first = next(rows, None)
    if first is None:
        return header, iter(())
    typical = float(np.median(first[column.name]))
    logged = header.column("weight")
    kept = tuple(c for c in header.columns if c.quantity not in ("sigma", "weight"))
    noise = header.noise if is_raw(column.unit) else {**header.noise, sensor: to_si(typical, column.unit)}

    def weighed() -> Iterator[Batch]:
        rows_before = 0
        for batch in chain([first], rows):
            sigma = batch[column.name]
            wrong = np.flatnonzero(~(sigma > 0))
            if len(wrong):
                raise InputError(
                    f"{dropouts.place(rows_before + int(wrong[0]))}, column {column.name}: a sigma is positive, got "
                    f"{sigma[wrong[0]]:g}; leave such rows out"
                )
            rows_before += len(sigma)
            before = batch[logged.name] if logged else 1.0
            values = {name: x for name, x in batch.items() if name in {c.name for c in kept}}
            yield {**values, WEIGHT.name: before * (typical / sigma) ** 2}

    return replace(header, columns=(*kept, WEIGHT), noise=noise), weighed()


def _sensor_of_quantity(of: str) -> str:
    """Return the word of [noise] that speaks of a quantity; the noise of a star is that of its readout."""
    return SENSOR_OF.get(of, "gimbal_angle")
