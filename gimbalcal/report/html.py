"""A page that needs nothing else: templates filled, every value escaped, charts and their one script inside."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from markupsafe import Markup, escape

import gimbalcal
from gimbalcal.report.chart import Chart
from gimbalcal.report.draw import svg


@dataclass(frozen=True)
class Picture:
    """Charts as SVG, beside each other where there is room; what they show for those who cannot see; caption."""

    charts: tuple[Markup, ...]
    alt: str
    caption: str = ""


def picture(charts: Chart | Sequence[Chart | Markup], alt: str, caption: str = "") -> Picture:
    """Charts as a figure of the page."""
    several = (charts,) if isinstance(charts, Chart) else charts
    drawn = (Markup(svg(c)) if isinstance(c, Chart) else c for c in several)  # noqa: S704  escaped where it is drawn
    return Picture(tuple(drawn), alt, caption)


def formula(latex: str) -> Markup | None:
    """A formula as MathML, which every browser draws in the page's own letters; None where it cannot be set."""
    from latex2mathml.converter import convert

    try:
        text = convert(latex.replace("<", r"\lt "))  # it copies words of \text as they are: no tag may come through
        drawn = ET.fromstring(text)  # noqa: S314  made one line above
    except Exception:  # noqa: BLE001  its errors have no class in common
        return None
    # commands that it does not know are left as they are
    return None if "\\" in "".join(drawn.itertext()) else Markup(text)  # noqa: S704  no tag of the formula's own


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
    environment.filters["coded"] = coded
    told = {"version": gimbalcal.__version__, "script": Markup(_script()), "script_hash": _script_hash(), "date": ""}  # noqa: S704  our own
    return environment.get_template(template).render({**told, **context})


def coded(text: str) -> Markup:
    """A sentence with what stands between backticks as something to type; all else is escaped.

    >>> coded("see `gimbalcal apply`, `--with bias:y`, <b>")
    Markup('see <code>gimbalcal apply</code>, <code><span>--with</span> bias:y</code>, &lt;b&gt;')
    """

    def typed(found: re.Match[str]) -> str:
        options = re.sub(r"(?<!\S)-+[a-z]+", r"<span>\g<0></span>", found[1])
        return f"<code>{options}</code>"

    return Markup(re.sub(r"`([^`]*)`", typed, str(escape(text))))  # noqa: S704  escaped before


@cache
def _script() -> str:
    return (files("gimbalcal.report") / "templates" / "page.js").read_text(encoding="utf-8")


def _script_hash() -> str:
    """What the page's security policy lets run: this script and no other."""
    return "sha256-" + b64encode(sha256(_script().encode()).digest()).decode()


MARK = '<meta name="gimbalcal-question" content="'


def marked(page: str, question: str) -> str:
    """The page with the question it answers in its head, so that the same question may replace it."""
    return page.replace("<head>", f'<head>\n{MARK}{question}">', 1) if question else page


def question_of(page: Path) -> str:
    """The question that a page on disk answers; empty where it does not say, or is no page."""
    try:
        with page.open(encoding="utf-8", errors="replace") as file:
            head = file.read(2000)
    except OSError:
        return ""
    found = re.search(re.escape(MARK) + r'([^"]*)"', head)
    return found[1] if found else ""
