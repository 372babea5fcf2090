"""Render a page that needs no other file: templates filled, every value escaped, charts and their one script inside."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

import gimbalcal
from gimbalcal.report.chart import Chart
from gimbalcal.report.svg import svg

Context = dict[str, Any]  # values that a template places, by name


@dataclass(frozen=True)
class Picture:
    """Charts as SVG, side by side where they fit; a description for those who cannot see them; a caption."""

    charts: tuple[Markup, ...]
    alt: str
    caption: str = ""


def picture(charts: Chart | Sequence[Chart | Markup], alt: str, caption: str = "") -> Picture:
    """Return charts as a figure of the page."""
    each = (charts,) if isinstance(charts, Chart) else charts
    drawn = (Markup(svg(c)) if isinstance(c, Chart) else c for c in each)  # noqa: S704  escaped where it is drawn
    return Picture(tuple(drawn), alt, caption)


def render(template: str, context: Context) -> str:
    """Return a template of this package, filled; every value is escaped and a missing one is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("gimbalcal.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["coded"] = with_code
    common = {"version": gimbalcal.__version__, "script": Markup(_script()), "script_hash": _script_hash(), "date": ""}  # noqa: S704  our own
    return environment.get_template(template).render({**common, **context})


def with_code(text: str) -> Markup:
    """Return a sentence with the text between backticks as code; all else is escaped.

    >>> with_code("see `gimbalcal apply`, `--with bias:y`, <b>")
    Markup('see <code>gimbalcal apply</code>, <code><span>--with</span> bias:y</code>, &lt;b&gt;')
    """

    def typed(match: re.Match[str]) -> str:
        options = re.sub(r"(?<!\S)-+[a-z]+", r"<span>\g<0></span>", match[1])
        return f"<code>{options}</code>"

    return Markup(re.sub(r"`([^`]*)`", typed, str(escape(text))))  # noqa: S704  escaped before


@cache
def _script() -> str:
    return (files("gimbalcal.report") / "templates" / "page.js").read_text(encoding="utf-8")


def _script_hash() -> str:
    """Return the hash by which the page's security policy admits this script and no other."""
    return "sha256-" + b64encode(sha256(_script().encode()).digest()).decode()


MARK = '<meta name="gimbalcal-question" content="'


def page_with_question(page: str, question: str) -> str:
    """Return the page with the question it answers in its head, so that the same question may replace it."""
    return page.replace("<head>", f'<head>\n{MARK}{question}">', 1) if question else page


def question_of(page: Path) -> str:
    """Return the question that a page on disk answers; empty where it does not state one, or is no page."""
    try:
        with page.open(encoding="utf-8", errors="replace") as file:
            head = file.read(2000)
    except OSError:
        return ""
    match = re.search(re.escape(MARK) + r'([^"]*)"', head)
    return match[1] if match else ""
