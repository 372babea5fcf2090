"""Shares of a campaign on disk: each whole or not there, found again after a stop, joined into one Parquet file."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gimbalcal import atomic
from gimbalcal.campaign.task import COLUMNS, Task
from gimbalcal.errors import InputError

TABLE, SUMMARY, PARTS = "campaign.parquet", "campaign.json", "campaign.parts"


@dataclass(frozen=True)
class Store:
    """The folder of one campaign."""

    folder: Path
    task: Task
    count: int

    @property
    def parts(self) -> Path:
        """Where shares wait until all are there."""
        return self.folder / PARTS

    def shares(self) -> list[range]:
        """All runs in shares of fixed size."""
        size = self.task.share
        return [range(i, min(i + size, self.count)) for i in range(0, self.count, size)]

    def open(self) -> list[range]:
        """The shares still to compute. Raises InputError where the folder holds another campaign."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._check(self.folder / SUMMARY)
        self._check(self.parts / "identity.json")
        self.parts.mkdir(exist_ok=True)
        atomic.write_json(self.parts / "identity.json", {"identity": self.task.identity})
        self._take_over()
        return [s for s in self.shares() if not self._part(s).is_file()]

    def _check(self, path: Path) -> None:
        if not path.is_file():
            return
        try:
            found = json.loads(path.read_text())["identity"]
        except (json.JSONDecodeError, KeyError, TypeError):
            found = None
        if found != self.task.identity:
            raise InputError(
                f"{self.folder} holds another campaign (other scenario, seed, method or version): give another --out, "
                f"or remove {TABLE}, {SUMMARY} and {PARTS} there"
            )

    def _take_over(self) -> None:
        """Shares of a finished campaign count, so that more runs can be added to it."""
        import polars as pl

        table = self.folder / TABLE
        if not table.is_file() or not (self.folder / SUMMARY).is_file():
            return
        rows = pl.read_parquet(table.absolute(), glob=False)
        present = set(rows["run"].unique().to_list())
        for share in self.shares():
            if not self._part(share).is_file() and present.issuperset(share):
                self.keep(share, rows.filter(pl.col("run").is_between(share.start, share.stop - 1)).to_dict())

    def _part(self, share: range) -> Path:
        return self.parts / f"{share.start:08d}-{share.stop:08d}.parquet"

    def keep(self, share: range, columns: Mapping[str, Any]) -> None:
        """Write one share, whole or not at all."""
        import polars as pl

        with atomic.file(self._part(share)) as path:
            pl.DataFrame({name: columns[name] for name in COLUMNS}, schema=_schema()).write_parquet(path)

    def finish(self, summarise: Any) -> dict[str, Any]:
        """Join all shares into campaign.parquet, write campaign.json, and remove the shares."""
        import polars as pl

        rows = pl.concat([pl.read_parquet(self._part(share).absolute(), glob=False) for share in self.shares()])
        summary: dict[str, Any] = {"format": 1, "identity": self.task.identity, **summarise(rows)}
        with atomic.file(self.folder / TABLE) as path:
            rows.write_parquet(path)
        atomic.write_json(self.folder / SUMMARY, summary)
        shutil.rmtree(self.parts)
        return summary


def _schema() -> dict[str, Any]:
    import polars as pl

    text = ("parameter", "unit", "outcome")
    whole = ("run", "dof")
    return {c: pl.String if c in text else pl.Int64 if c in whole else pl.Float64 for c in COLUMNS}
