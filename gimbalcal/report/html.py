"""A page that needs nothing else: templates filled, every value escaped, pictures inside."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import gimbalcal

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure inside the page: data URI, what it shows in words for those who cannot see it, caption."""

    uri: str
    alt: str
    caption: str = ""


def picture(figure: Figure, alt: str, caption: str = "") -> Picture:
    """A matplotlib figure as SVG inside the page."""
    from gimbalcal.report.style import svg

    return Picture("data:image/svg+xml;base64," + b64encode(svg(figure)).decode(), alt, caption)


def render(template: str, context: Mapping[str, Any]) -> str:
    """A template of this package, filled; every value is escaped and a missing one is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("gimbalcal.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(version=gimbalcal.__version__, **context)
