"""Typeset a LaTeX formula as MathML for a page."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from markupsafe import Markup


def formula(latex: str) -> Markup | None:
    """Return a formula as MathML, which every browser draws in the page's own letters; None where it cannot be set."""
    from latex2mathml.converter import convert

    # brackets stretch over a matrix only as a pair of their own
    latex = latex.replace(r"\begin{bmatrix}", r"\left[\begin{matrix}").replace(r"\end{bmatrix}", r"\end{matrix}\right]")
    try:
        text = convert(latex.replace("<", r"\lt "))  # it copies words of \text as they are: no tag may come through
        drawn = ET.fromstring(text)  # noqa: S314  made one line above
    except Exception:  # noqa: BLE001  its errors have no class in common
        return None
    # commands that it does not know are left as they are
    return None if "\\" in "".join(drawn.itertext()) else Markup(text)  # noqa: S704  no tag of the formula's own
