"""Shares of a campaign on disk: each whole or not there, found again after a stop, joined into one Parquet file.

A share carries its digest: one that was damaged on disk is computed again.
"""

from __future__ import annotations

import fcntl
import io
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from gimbalcal import atomic
from gimbalcal.campaign.task import COLUMNS, Identity, Task
from gimbalcal.entries import Entry, Json
from gimbalcal.errors import InputError

if TYPE_CHECKING:
    import polars as pl

TABLE, SUMMARY, PARTS, PAGE = "campaign.parquet", "campaign.json", "campaign.parts", "report.html"
IDENTITY = "identity.json"
DIGITS = 16  # of a digest in the name of a part


@dataclass(frozen=True)
class ParameterErrors(Entry):
    """Mean and RMS error of a parameter over the runs, its predicted RMS sigma, and their ratio (nan without one)."""

    parameter: str
    unit: str
    runs: int
    mean: float
    rms: float
    sigma: float
    ratio: float


@dataclass(frozen=True)
class CampaignSummary(Entry):
    """The content of campaign.json; `outcomes` counts the runs that ended with each of the most frequent sentences."""

    format: int
    identity: Identity
    sha256: str
    direction: str
    runs: int
    failed: int
    outcomes: Mapping[str, int]
    parameters: tuple[ParameterErrors, ...]
    in_words: str


@dataclass(frozen=True)
class CampaignFolder:
    """The folder of one campaign."""

    folder: Path
    task: Task
    count: int

    @property
    def parts(self) -> Path:
        """Return the place where shares wait until all are there."""
        return self.folder / PARTS

    def shares(self) -> list[range]:
        """Return all runs in shares of fixed size."""
        size = self.task.share
        return [range(i, min(i + size, self.count)) for i in range(0, self.count, size)]

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the folder for this process until the block or the process ends; InputError where another one has it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self.folder, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise InputError(
                f"another campaign is at work in {self.folder}: wait for it, or give another --out"
            ) from None
        try:
            yield
        finally:
            os.close(descriptor)

    def open(self) -> list[range]:
        """Return the shares still to compute. Raises InputError where the folder holds another campaign."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._check(self.folder / SUMMARY)
        self._check(self.parts / IDENTITY)
        self.parts.mkdir(exist_ok=True)
        atomic.write_json(self.parts / IDENTITY, {"identity": self.task.identity.to_dict()})
        self._take_over()
        kept = self._kept()
        return [s for s in self.shares() if s not in kept]

    def give_way(self) -> None:
        """Remove another campaign from the folder; this one's own runs stay, and so does what is no campaign's."""
        try:
            self._check(self.folder / SUMMARY)
            self._check(self.parts / IDENTITY)
        except InputError:
            for name in (SUMMARY, TABLE, PAGE):
                (self.folder / name).unlink(missing_ok=True)
            shutil.rmtree(self.parts, ignore_errors=True)

    def _check(self, path: Path) -> None:
        if not path.is_file():
            return
        try:
            identity = json.loads(path.read_text(encoding="utf-8"))["identity"]
        except (ValueError, KeyError, TypeError):
            raise InputError(
                f"{path} is damaged, so it is not known which campaign is in {self.folder}: give another --out, "
                "or --overwrite to replace"
            ) from None
        if identity != self.task.identity.to_dict():
            raise InputError(
                f"{self.folder} holds another campaign (other scenario, seed, method or version), which would be "
                "lost; give another --out, or --overwrite to replace"
            )

    def _take_over(self) -> None:
        """Take over the shares of a finished campaign, so that runs can be added; repeat a damaged one."""
        import polars as pl

        table, summary = self.folder / TABLE, self.folder / SUMMARY
        if not table.is_file() or not summary.is_file():
            return
        if json.loads(summary.read_text(encoding="utf-8")).get("sha256") != _digest(table.read_bytes()):
            return
        rows = pl.read_parquet(table.absolute(), glob=False)
        present, kept = set(rows["run"].unique().to_list()), self._kept()
        for share in self.shares():
            if share not in kept and present.issuperset(share):
                self.keep(share, rows.filter(pl.col("run").is_between(share.start, share.stop - 1)).to_dict())

    def _kept(self) -> dict[range, Path]:
        """Return the sound file of each share that has one: its name ends with the digest of what is in it."""
        shares = {_name(share): share for share in self.shares()}
        kept: dict[range, Path] = {}
        for path in sorted(self.parts.glob("*.parquet")):
            name, _, digest = path.stem.rpartition("-")
            if name in shares and digest == _digest(path.read_bytes())[:DIGITS]:
                kept.setdefault(shares[name], path)
        return kept

    def keep(self, share: range, columns: Json) -> None:
        """Write one share, whole or not at all."""
        import polars as pl

        content = io.BytesIO()
        pl.DataFrame({name: columns[name] for name in COLUMNS}, schema=_schema()).write_parquet(content)
        digest = _digest(content.getvalue())[:DIGITS]
        atomic.write(self.parts / f"{_name(share)}-{digest}.parquet", content.getvalue())

    def finish(
        self,
        summarise: Callable[[pl.DataFrame, str], CampaignSummary],
        page: Callable[[CampaignSummary], str] | None,
    ) -> CampaignSummary:
        """Join all shares into campaign.parquet, write campaign.json and a page, all or none; remove the shares.

        summarise: returns the summary of all rows, whose file has this SHA-256.
        """
        import polars as pl

        kept = self._kept()
        lost = [share for share in self.shares() if share not in kept]
        if lost:
            raise InputError(
                f"{self.parts}: runs {lost[0].start} to {lost[0].stop - 1} were changed or removed while the campaign "
                "went on; the same command computes them again"
            )
        rows = pl.concat([pl.read_parquet(kept[share].absolute(), glob=False) for share in self.shares()])
        with atomic.atomic_folder(self.folder, last=SUMMARY) as new:
            rows.write_parquet(new / TABLE)
            summary = summarise(rows, _digest((new / TABLE).read_bytes()))
            atomic.write_json(new / SUMMARY, summary.to_dict())
            if page is not None:
                atomic.write(new / PAGE, page(summary))
        shutil.rmtree(self.parts)
        return summary


def _name(share: range) -> str:
    return f"{share.start:08d}-{share.stop:08d}"


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()


def _schema() -> Json:
    import polars as pl

    text = ("parameter", "unit", "outcome")
    whole = ("run", "dof")
    return {c: pl.String if c in text else pl.Int64 if c in whole else pl.Float64 for c in COLUMNS}
