"""Entries of result files: frozen dataclasses that are written to JSON field by field and read back with their types.

A field that is None is absent from the file. A field whose name is a word of Python ends in an underscore, which the
file does not show.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from gimbalcal.errors import InputError, shortened_text

Json = dict[str, Any]  # the content of a JSON file, or of an object in it
E = TypeVar("E")
MAX_BYTES = 100_000_000  # of a file; a hundred parameters with their covariance are a quarter of a megabyte
MAX_SHOWN = 40  # characters of a value in a message


class Entry:
    """Base of the parts of a result: `to_dict` writes the fields, and `entry["key"]` reads one by its name in the file.

    Subclasses are frozen dataclasses. `entry_from` reads one.
    """

    __pydantic_config__: ClassVar[Json] = {"alias_generator": lambda name: name.rstrip("_")}

    def to_dict(self) -> Json:
        """Return the entry as it stands in the file."""
        return fields_of(self)

    def __getitem__(self, key: str) -> Any:
        """Return a field by its name in the file."""
        return self.to_dict()[key]


def fields_of(value: Any) -> Json:
    """Return the fields of a dataclass by their names in a file, those that are None left out."""
    every = {f.name.rstrip("_"): getattr(value, f.name) for f in fields(value)}
    return {key: plain_json(one) for key, one in every.items() if one is not None}


def plain_json(value: Any) -> Any:
    """Return a value in the types of JSON."""
    if isinstance(value, str):  # also a kind of recording, which is a string with fields
        return str(value)
    if isinstance(value, Entry):
        return value.to_dict()
    if is_dataclass(value):
        return fields_of(value)
    if isinstance(value, Mapping):
        return {key: plain_json(one) for key, one in value.items()}
    return [plain_json(one) for one in value] if isinstance(value, (tuple, list)) else value


def entry_from(cls: type[E], content: object, where: str) -> E:
    """Return the entry in the content of a file; keys that it does not have are ignored.

    where: place of the content in the file. Raises InputError, which names the place of a value of another type.
    """
    from pydantic import TypeAdapter, ValidationError

    try:
        return TypeAdapter(cls).validate_python(content)
    except ValidationError as problem:
        first = problem.errors()[0]
        steps = (step + 1 if isinstance(step, int) else step for step in first["loc"])
        place = " / ".join(map(str, filter(None, (where, *steps)))) or "the content"
        if first["type"] == "missing":
            raise InputError(f"{place} is missing") from None
        raise InputError(
            f"{place} cannot be {shortened_text(repr(first['input']), MAX_SHOWN)}: {expected_in_words(first)}"
        ) from None


def expected_in_words(problem: Mapping[str, Any]) -> str:
    """Return in words what is expected where a validation error of pydantic lies."""
    kind, message = problem["type"].rpartition("_")[0], problem["msg"].removeprefix("Value error, ")
    return f"it must be {WANTED[kind]}" if kind in WANTED else message.replace("Input should be", "it must be", 1)


WANTED = {
    "tuple": "a list", "list": "a list", "string": "a text", "dict": "a table of keys", "mapping": "a table of keys",
    "dataclass": "a table of keys", "model": "a table of keys", "int": "a whole number", "float": "a number",
    "bool": "true or false", "finite": "a finite number", "int_from": "a whole number",
}  # fmt: skip


def read_json(path: Path, wanted: str) -> Any:
    """Return the content of a JSON file. Raises InputError, which names the place where it is none.

    wanted: the file to give instead, in words.
    """
    if not path.is_file():
        raise InputError(f"there is no {path}; give {wanted}")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path} has {path.stat().st_size / 1e6:.0f} MB, more than any result; give {wanted}")
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
        json.dumps(content, ensure_ascii=False).encode()
    except UnicodeDecodeError as problem:
        raise InputError(f"{path} is not text in UTF-8 (byte {problem.start}); give {wanted}") from None
    except UnicodeEncodeError:
        raise InputError(f"{path} holds half of a character (an unpaired surrogate); give {wanted}") from None
    except json.JSONDecodeError as problem:
        raise InputError(f"{path}, line {problem.lineno}, column {problem.colno}: no JSON; give {wanted}") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path} holds a number of too many digits, or too many brackets; give {wanted}") from None
    return content
