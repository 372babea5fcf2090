"""Write a LaTeX formula as a line of letters."""

from __future__ import annotations

import re
from unicodedata import normalize

LETTERS = {
    "delta": "δ", "theta": "θ", "omega": "ω", "varphi": "φ", "phi": "φ", "beta": "β", "kappa": "κ", "pi": "π",
    "tau": "τ", "Delta": "Δ", "varepsilon": "ε", "epsilon": "ε", "vartheta": "ϑ", "psi": "ψ", "xi": "ξ", "mu": "µ",
    "lambda": "λ", "gamma": "γ", "Omega": "Ω", "alpha": "α", "sigma": "σ", "eta": "η", "rho": "ρ", "chi": "χ",
    "times": "×", "cdot": "·", "int": "∫", "sum": "Σ", "infty": "∞", "geq": "≥", "leq": "≤", "ge": "≥", "le": "≤",
    "Rightarrow": "⇒", "to": "→", "cdots": "...", "ldots": "...", "pm": "±", "approx": "≈", "qquad": "\t", "quad": "\t",
    "left": "", "right": "",
}  # fmt: skip
ACCENTS = {"dot": "\u0307", "bar": "\u0304", "hat": "\u0302", "tilde": "\u0303"}
PART = r"\{([^{}]*)\}"


def plain_formula(latex: str) -> str:
    r"""Return the formula as a line of text: Greek letters, fractions as quotients.

    >>> plain_formula(r"\delta a_i = b_{T,i} (T - T_0)"), plain_formula(r"d = -\frac{f}{g}, \qquad \dot f = \sqrt{2}")
    ('δa_i = b_T,i (T - T_0)', 'd = -f/g,  ḟ = √(2)')
    """
    text = re.sub(r"\\begin\{\w+\}(.*?)\\end\{\w+\}", _rows, latex, flags=re.DOTALL)
    text = re.sub(r"\\[,;!: ]|~", " ", text)
    text = re.sub(rf"\\(?:operatorname|text|mathrm|mathbf){PART}", r"\1", text)
    while (inner := re.sub(rf"([_^]){PART}", _index, text)) != text:
        text = inner
    text = re.sub(rf"\\frac{PART}{PART}", lambda m: f"{_bracketed(m[1])}/{_bracketed(m[2])}", text)
    text = re.sub(rf"\\frac(\w)(\w)|\\frac(\d) ?{PART}", lambda m: f"{m[1] or m[3]}/{m[2] or m[4]}", text)
    text = re.sub(rf"\\sqrt{PART}", r"√(\1)", text)
    text = re.sub(rf"\\({'|'.join(ACCENTS)}) ?{PART}", lambda m: m[2] + ACCENTS[m[1]], text)
    text = re.sub(rf"\\({'|'.join(ACCENTS)})\s*(\\?\w[a-z]*|\w)", lambda m: _accented(m[1], m[2]), text)
    text = re.sub(r"\\([A-Za-z]+)", lambda m: LETTERS.get(m[1], m[1]), text)
    text = re.sub(r"[{}]|(?<=[δΔ]) (?=\w)|\\", "", text)
    return normalize("NFC", re.sub(r" *\t *", "  ", re.sub(r"[ \n]+", " ", text)).strip())


def _rows(match: re.Match[str]) -> str:
    """Return a matrix as rows between brackets."""
    rows = [", ".join(cell.strip() for cell in row.split("&")) for row in match[1].split(r"\\")]
    return f"[{'; '.join(rows)}]"


def _index(match: re.Match[str]) -> str:
    """Return an index or power, in brackets where it is more than one word."""
    inside = match[2].strip()
    bracketed = inside.startswith("(") and inside.endswith(")") and ")" not in inside[:-1]
    return match[1] + (f"({inside})" if re.search(r"[-+= /]", inside[1:]) and not bracketed else inside)


def _bracketed(part: str) -> str:
    """Return numerator or denominator, in brackets where it is more than one factor."""
    return part if re.fullmatch(r"\\?\w+(?:[_^]\w+)?", part.strip()) else f"({part})"


def _accented(accent: str, what: str) -> str:
    letter = LETTERS.get(what[1:], what[1:]) if what.startswith("\\") else what
    return letter[:1] + ACCENTS[accent] + letter[1:]
