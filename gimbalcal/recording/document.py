"""A TOML file that remembers its lines, so that every refusal can name one."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from gimbalcal.errors import InputError, list_of_alternatives, shortened_text
from gimbalcal.quantities import refuse_unit
from gimbalcal.units import to_si

# A NumPy scalar printed with repr() under NumPy >= 2 reads `np.float64(6.4e-05)`, which is not TOML. Programs that
# write recordings have let it through, so this one pattern is put right, with a remark; nothing else is.
_NUMPY_SCALAR = re.compile(r"np\.float64\(\s*([-+0-9.eE]+)\s*\)")


MAX_DOCUMENT_BYTES = 20_000_000  # bytes
MAX_STATED_NUMBER = 1e100  # nothing that is measured comes near; its square is still a number


def _too_long(content: Any, key: str = "") -> Iterator[str]:
    """Yield keys of whole numbers that TOML does not have; some have so many digits that nobody can print them."""
    if isinstance(content, dict | list):
        for name, value in content.items() if isinstance(content, dict) else enumerate(content, start=1):
            yield from _too_long(value, f"{key}.{name}".lstrip("."))
    elif isinstance(content, int) and not -(2**63) <= content < 2**63:
        yield key


class Document:
    """The parsed file together with its text."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            if path.stat().st_size > MAX_DOCUMENT_BYTES:
                raise InputError(f"{path} has {path.stat().st_size / 1e6:.0f} MB, which no description has")
            text = path.read_text(encoding="utf-8-sig")
        except UnicodeDecodeError as error:
            raise InputError(f"{path} is not UTF-8 text (byte {error.start}): save it as UTF-8") from None
        self.lines = text.split("\n")  # not splitlines(): TOML ends a line at nothing else
        self.remarks = self._repair()
        try:
            self.content: dict[str, Any] = tomllib.loads("\n".join(self.lines))
            beyond = next(_too_long(self.content), "")
        except tomllib.TOMLDecodeError as error:
            where = re.search(r"at line (\d+), column (\d+)", str(error))
            line = f"line {where[1]}, column {where[2]}" if where else f"line {len(self.lines)}"
            what = re.sub(r"\s*\(at .*\)$", "", str(error))
            raise InputError(f"{path}, {line}: {what}; this line is not valid TOML, correct it") from None

        except (ValueError, RecursionError) as error:  # integers of thousands of digits, brackets and dots
            raise InputError(
                f"{path} is beyond what TOML is for: {shortened_text(str(error), 100)}; correct it"
            ) from None
        if beyond:
            raise InputError(
                f"{path}: {shortened_text(beyond)} is a whole number of more than 64 bits, which TOML does not have"
            )

    @classmethod
    def of(cls, content: Mapping[str, Any], path: Path) -> Document:
        """Return a document that is no file: its content as TOML would give it, called `path` in sentences."""
        document = cls.__new__(cls)
        document.path, document.lines, document.remarks, document.content = path, [], (), dict(content)
        return document

    def _repair(self) -> tuple[str, ...]:
        remarks = []
        for i, line in enumerate(self.lines):
            bare, sep, comment = line.partition("#")
            mended = _NUMPY_SCALAR.sub(r"\1", bare)
            if mended != bare:
                self.lines[i] = mended + sep + comment
                remarks.append(
                    f"{self.path}, line {i + 1}: a NumPy scalar was printed where a number belongs; "
                    f"read as {mended.strip()}"
                )
        return tuple(remarks)

    def where(self, table: str = "", key: str = "") -> str:
        """Return ``path, line n`` of `key` in `table`, or of the table itself where the key is not there."""
        inside, table_line = not table, 0
        for i, line in enumerate(self.lines, start=1):
            heading = re.match(r"\s*\[+\s*([^\]]+?)\s*\]+", line)
            if heading:
                inside = heading[1] == table
                table_line = i if inside else table_line
            if key and inside and re.match(rf"""\s*["']?{re.escape(key)}["']?\s*=""", line):
                return f"{self.path}, line {i}"
        return f"{self.path}, line {table_line}" if table_line else f"{self.path}"

    def table(self, name: str) -> dict[str, Any]:
        """Return the table `name`, empty where the file has none."""
        value = self.content.get(name, {})
        if not isinstance(value, dict):
            raise InputError(f"{self.where('', name)}: {name} must be a table, write [{name}]")
        return value

    def text(self, key: str, default: str) -> str:
        """Return the text `key` above all tables."""
        value = self.content.get(key, default)
        if not isinstance(value, str):
            raise InputError(f'{self.where("", key)}: {key} must be a text, as in {key} = "...", got {value!r:.60}')
        return value

    def tables(self, name: str, entries: object) -> list[dict[str, Any]]:
        """Return the entries of an array of tables."""
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise InputError(f"{self.where(name)}: {name} must be tables, each under its own [[{name}]]")
        return entries

    def only(self, table: str, known_keys: tuple[str, ...], content: Mapping[str, Any]) -> None:
        """Refuse a key that nobody reads: it is most likely a slip of the pen."""
        for key in content:
            if key not in known_keys:
                place = f" in [{table}]" if table else ""
                raise InputError(
                    f"{self.where(table, key)}: {key!r}{place} is not known; write one of "
                    f"{list_of_alternatives(known_keys)}"
                )

    def number(self, table: str, key: str, entry: object, quantity: str) -> float:
        """Return a number with a unit, ``{ value = 40.0, unit = "deg" }``, in SI."""
        where = self.where(table, key)
        if not isinstance(entry, dict) or set(entry) != {"value", "unit"}:
            raise InputError(
                f'{where}: {key} needs a number and its unit, write {key} = {{ value = ..., unit = "..." }}'
            )
        value, unit = entry["value"], entry["unit"]
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < MAX_STATED_NUMBER:
            raise InputError(f"{where}: the value of {key} must be a finite number, got {shortened_text(repr(value))}")
        return to_si(float(value), self.unit(where, key, unit, quantity))

    def unit(self, where: str, name: str, unit: object, quantity: str) -> str:
        """Return `unit`, if it is one of `quantity`."""
        if not isinstance(unit, str):
            raise InputError(f'{where}: the unit of {name} must be a text such as unit = "m/s^2", got {unit!r}')
        try:
            refuse_unit(unit, quantity)
        except InputError as error:
            raise InputError(f"{where}, {name}: {error}") from None
        return unit
