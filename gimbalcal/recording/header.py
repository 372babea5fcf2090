"""`recording.toml`: what is in the samples, checked line by line."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path, PureWindowsPath
from typing import Any

from gimbalcal.errors import InputError, list_of_alternatives, shortened_text
from gimbalcal.platform import BENCH, KNOWN, Axis, Platform, known_platform
from gimbalcal.recording.columns import RATE_OF, Column, columns_of
from gimbalcal.recording.dates import recorded_on
from gimbalcal.recording.document import Document
from gimbalcal.recording.kinds import KINDS, Kind, kind_of
from gimbalcal.recording.lines import has_names
from gimbalcal.recording.record import COLOURED, SENSORS, Site
from gimbalcal.recording.site import site_of
from gimbalcal.units import is_raw

NAME = "recording.toml"
KEYS = ("format", "kind", "title", "date", "corrected", "samples", "site", "platform", "noise", "columns")


@dataclass(frozen=True)
class Header:
    """The content of a `recording.toml`."""

    path: Path
    kind: Kind
    title: str
    samples: Path
    site: Site
    platform: Platform
    noise: Mapping[str, float]
    noise_of: Mapping[str, Mapping[str, float]]  # by sensor, what [noise.b] states for the one called b
    columns: tuple[Column, ...]
    remarks: tuple[str, ...]
    skip: int = 0  # lines of the samples file before its line of column names
    named: bool = True  # whether there is a line of column names
    date: str = ""  # when it was recorded, ISO 8601
    corrected: tuple[str, ...] = ()  # the calibrations that corrected it
    instant: bool = False  # whether forces and rates are those of the row's time, not means over the interval before it

    def column(self, quantity: str) -> Column | None:
        """Return the first column of `quantity`."""
        return next((c for c in self.columns if c.quantity == quantity), None)


def read_header(folder: Path) -> Header:
    """Read and check ``folder/recording.toml``; every refusal is an `InputError` that names the line.

    The header itself stands for its folder.
    """
    folder = folder.parent if folder.name == NAME and folder.is_file() else folder
    path = folder / NAME
    if not folder.is_dir():
        hint = (
            "" if not folder.is_file()
            else "; gimbalcal.read_calibration reads a calibration" if folder.suffix == ".json"
            else f"; `gimbalcal new {folder}` makes one of a log"
        )  # fmt: skip
        raise InputError(f"{folder} is not a folder: a recording is a folder with a {NAME} in it{hint}")
    if not path.is_file():
        raise InputError(f"{folder} has no {NAME}: a recording is a folder with a {NAME} that says what is in it")
    document = Document(path)
    header = _header(document, _samples(document, folder))
    return replace(header, named=has_names(header.samples, [c.name for c in header.columns]))


def foreign_header(path: Path, samples: Path, skip: int, clock_needed: bool = True) -> Header:
    """Return the header that the TOML file `path` gives to rows that are in another program's file, `samples`.

    Where no clock is needed, because rows are counted instead, the columns may be without one.
    """
    if not path.is_file():
        raise InputError(
            f"{path} does not exist; it must say what the columns of {samples} hold, as recording.toml does"
        )
    document = Document(path)
    title = document.text("title", samples.stem)
    return replace(_header(document, samples, clock_needed), skip=skip, title=title)


def header_of(content: Mapping[str, Any], name: Path, platform: Platform | None = None) -> Header:
    """Return the header with this content of a recording.toml, for rows in no file; sentences call them `name`.

    platform: instead of one that the content names or spells out.
    """
    return _header(Document.of(content, name), name, platform=platform)


def _header(document: Document, samples: Path, clock_needed: bool = True, platform: Platform | None = None) -> Header:
    content, path = document.content, document.path
    document.only("", KEYS, content)
    if content.get("format") != 1:
        raise InputError(f"{document.where('', 'format')}: format must be 1, got {content.get('format')!r}")
    name = content.get("kind")
    if not isinstance(name, str) or name not in KINDS:
        raise InputError(
            f"{document.where('', 'kind')}: kind must be one of {list_of_alternatives([*KINDS])}, got {name!r}"
        )
    platform = platform or platform_of(document, KINDS[name].stabilised)
    kind = kind_of(name, platform)
    columns = columns_of(document, platform, clock_needed)
    site, remarks = site_of(document, kind)
    remarks = remarks if kind.inertial else ()  # no star feels gravity
    return Header(
        path=path,
        kind=kind,
        title=document.text("title", path.resolve().parent.name),
        samples=samples,
        date=recorded_on(content.get("date", ""), document.where("", "date")),
        site=site,
        platform=platform,
        noise=_noise(document, kind, columns),
        noise_of=_noise_of(document, kind, columns),
        columns=columns,
        remarks=document.remarks + remarks,
        corrected=_applied_calibrations(document),
        instant=_states_the_instant(document, columns),
    )


def _applied_calibrations(document: Document) -> tuple[str, ...]:
    """Return the calibrations that `corrected` names."""
    names = document.content.get("corrected", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{document.where('', 'corrected')}: corrected must be a list of texts, as `apply` writes it")
    return tuple(names)


def _states_the_instant(document: Document, columns: tuple[Column, ...]) -> bool:
    """Return whether [samples] states readings of the instant, not means over the interval that ends at the row."""
    table = document.content.get("samples")
    if not isinstance(table, dict):
        return False
    document.only("samples", ("file", "rates"), table)
    rates, where = table.get("rates", "mean"), document.where("samples", "rates")
    if rates not in ("mean", "instant"):
        raise InputError(f'{where}: rates must be "mean" or "instant", got {rates!r}')
    increments = next((c for c in columns if c.quantity in RATE_OF), None)
    if rates == "instant" and increments:
        raise InputError(
            f'{where}: rates = "instant", but column {increments.name!r} holds increments, which are over an '
            "interval; take the line out"
        )
    return bool(rates == "instant")


def _samples(document: Document, folder: Path) -> Path:
    name, where = document.content.get("samples"), document.where("", "samples")
    if isinstance(name, dict):
        name, where = name.get("file"), document.where("samples", "file")
    if name is None:
        alone = (folder / "samples.parquet").is_file() and not (folder / "samples.csv").is_file()
        name = "samples.parquet" if alone else "samples.csv"
    if not isinstance(name, str) or not name:
        raise InputError(f'{where}: samples must be the name of a file, as in samples = "samples.csv", got {name!r}')
    path = folder / name
    inside = _lies_in_folder(path, folder)
    if inside is None or PureWindowsPath(name).drive or "\\" in name:
        raise InputError(
            f"{where}: samples = {shortened_text(repr(name))} is no name of a file here; put the file into the folder "
            "of the recording and write its name alone"
        )
    if Path(name).is_absolute() or not inside:
        raise InputError(f"{where}: samples = {name!r} leaves the folder of the recording; put the file inside it")
    if path.suffix not in (".csv", ".parquet"):
        raise InputError(
            f"{where}: samples = {name!r} must end in .csv or .parquet; `gimbalcal import` converts others"
        )
    if path.is_dir():
        raise InputError(f"{where}: samples = {name!r} is a folder; write the name of the file with the rows")
    if not path.is_file():
        raise InputError(f"{where}: the samples file {path} does not exist; put it there or correct its name")
    return path


def _lies_in_folder(path: Path, folder: Path) -> bool | None:
    """Return whether `path`, links followed, lies in `folder`; None if it is no path (too long, a link to itself)."""
    try:
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()  # since Python 3.13 neither `exists` nor `resolve` minds a link to itself
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):
        return None


def platform_of(document: Document, stabilised: bool) -> Platform:
    """Return the platform that [platform] names, or spells out."""
    table = document.table("platform")
    document.only("platform", ("name", "axes"), table)
    if "axes" in table:
        return Platform(str(table.get("name", "own")), _axes(document, table["axes"]))
    name = table.get("name", BENCH.name)
    platform = known_platform(name, stabilised) if isinstance(name, str) else None
    if platform is None:
        raise InputError(
            f"{document.where('platform', 'name')}: the platform {name!r} is not known; write one of "
            f"{list_of_alternatives(list(KNOWN))}, or spell its axes out in [[platform.axes]]"
        )
    return platform


def _axes(document: Document, entries: object) -> tuple[Axis, ...]:
    where = document.where("platform.axes")
    axes = []
    for entry in document.tables("platform.axes", entries):
        document.only("platform.axes", ("name", "direction", "sign", "offset"), entry)
        offset = document.number("platform.axes", "offset", entry["offset"], "angle") if "offset" in entry else 0.0
        try:
            axes.append(Axis(entry["name"], entry["direction"], entry.get("sign", 1), offset))
        except KeyError as error:
            raise InputError(
                f"{where}: an axis of the platform has no {error.args[0]}; each needs name and direction"
            ) from None
        except ValueError as error:
            raise InputError(f"{where}: {error}") from None
    return tuple(axes)


def _noise_of(document: Document, kind: Kind, columns: tuple[Column, ...]) -> dict[str, dict[str, float]]:
    """Return the noise that is stated for each of several sensors alone."""
    names = {c.sensor for c in columns if c.sensor}
    own = {name: document.table("noise")[name] for name in document.table("noise") if name in names}
    for name, table in own.items():
        if not isinstance(table, dict):
            raise InputError(f"{document.where('noise', name)}: {name} is a sensor, write [noise.{name}]")
    return {name: _noise(document, kind, columns, table, name) for name, table in own.items()}


def _noise(
    document: Document, kind: Kind, columns: tuple[Column, ...], table: Mapping[str, Any] | None = None, name: str = ""
) -> dict[str, float]:
    heading = f"noise.{name}" if name else "noise"
    if table is None:
        table = {key: entry for key, entry in document.table("noise").items() if key not in {c.sensor for c in columns}}
    columns = tuple(c for c in columns if not name or c.sensor == name)
    document.only(heading, (*SENSORS, *(COLOURED if kind.rotating else ())), table)
    noise = {}
    for sensor, entry in table.items():
        if sensor in COLOURED:
            noise[sensor] = _coloured_noise_size(document, heading, sensor, entry)
            continue
        noise[sensor] = document.number(heading, sensor, entry, SENSORS[sensor])
        where = document.where(heading, sensor)
        if noise[sensor] < 0:
            raise InputError(f"{where}: the noise of the {sensor} is a sigma and cannot be negative")
        logged = {is_raw(c.unit) for c in columns if RATE_OF.get(c.quantity, c.quantity) == SENSORS[sensor]}
        if logged and logged != {is_raw(entry["unit"])}:
            raise InputError(
                f"{where}: the noise of the {sensor} is in {entry['unit']}, its columns are not; counts or pulses "
                "have no known size, so give both in the same kind of unit"
            )
    return noise


def _coloured_noise_size(document: Document, heading: str, key: str, entry: object) -> float:
    """Return the size of a coloured noise."""
    size = document.number(heading, key, entry, COLOURED[key][1])
    if size < 0 or (not size and key.endswith("_tau")):
        raise InputError(f"{document.where(heading, key)}: {key} must be above zero, got {size:g}")
    return size
