"""Entries of result files: frozen dataclasses that are written to JSON field by field and read back with their types.

A field that is None is absent from the file. A field whose name is a word of Python ends in an underscore, which the
file does not show.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, TypeVar

from gimbalcal.errors import InputError

Json = dict[str, Any]  # the content of a JSON file, or of an object in it
E = TypeVar("E")
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
    return {key: plain(one) for key, one in every.items() if one is not None}


def plain(value: Any) -> Any:
    """Return a value in the types of JSON."""
    if isinstance(value, Entry):
        return value.to_dict()
    if is_dataclass(value):
        return fields_of(value)
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    return [plain(one) for one in value] if isinstance(value, (tuple, list)) else value


def entry_from(cls: type[E], content: object, where: str) -> E:
    """Return the entry in the content of a file; keys that it does not have are ignored.

    where: place of the content in the file. Raises InputError, which names the place of a value of another type.
    """
    from pydantic import TypeAdapter, ValidationError

    try:
        return TypeAdapter(cls).validate_python(content)
    except ValidationError as problem:
        first = problem.errors()[0]
        place = " / ".join(map(str, (where, *first["loc"])))
        text = repr(first["input"])
        shown = text if len(text) < MAX_SHOWN else f"{text[:30]}..."
        missing = first["type"] == "missing"
        raise InputError(f"{place} is missing" if missing else f"{place} cannot be {shown}: {first['msg']}") from None
