r"""Formulas of the effects' cards, LaTeX, as MathML: every browser draws it in the page's own letters, and it prints.

Only what cards and laws write: scripts, fractions, roots, accents, functions, matrices, Greek, \text.
"""

from __future__ import annotations

import re
from html import escape

GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "varepsilon": "ε", "zeta": "ζ", "eta": "η",
    "theta": "θ", "vartheta": "ϑ", "iota": "ι", "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "pi": "π",
    "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "ϕ", "varphi": "φ", "chi": "χ", "psi": "ψ", "omega": "ω", "Gamma": "Γ",
    "Delta": "Δ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ", "Pi": "Π", "Sigma": "Σ", "Phi": "Φ", "Psi": "Ψ",
    "Omega": "Ω", "infty": "∞", "ell": "ℓ",
}  # fmt: skip
SIGNS = {"times": "×", "cdot": "·", "cdots": "⋯", "geq": "≥", "leq": "≤", "neq": "≠", "approx": "≈", "pm": "±",
         "Rightarrow": "⇒", "rightarrow": "→", "to": "→", "int": "∫", "sum": "∑", "partial": "∂", "circ": "∘",
         "lvert": "|", "rvert": "|", "in": "∈"}  # fmt: skip
FUNCTIONS = ("sin", "cos", "tan", "cot", "sec", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "exp", "log",
             "ln", "min", "max", "asin", "acos", "atan")  # fmt: skip
SPACES = {",": "0.17em", ";": "0.28em", ":": "0.22em", "!": "-0.17em", " ": "0.25em", "quad": "1em", "qquad": "2em"}
ACCENTS = {"dot": "˙", "ddot": "¨", "bar": "¯", "hat": "^", "tilde": "~", "vec": "→"}
MINUS = {"-": "−", "*": "·"}  # as they are set
IGNORED = ("left", "right", "displaystyle", "limits", "big", "Big")
TOKEN = re.compile(r"\\[a-zA-Z]+|\\.|[0-9]+(?:\.[0-9]+)?|[^\s]", re.DOTALL)


def mathml(latex: str) -> str:
    r"""A formula as MathML.

    >>> mathml(r"K_2 f^2")
    '<math><mrow><msub><mi>K</mi><mn>2</mn></msub><msup><mi>f</mi><mn>2</mn></msup></mrow></math>'

    Raises ValueError for what this grammar does not hold.
    """
    text = latex.strip().strip("$").strip()
    text = text.removeprefix(r"\[").removesuffix(r"\]")
    # text within \text and \operatorname keeps its spaces
    kept: list[str] = []

    def keep(found: re.Match[str]) -> str:
        kept.append(found[2])
        name = "operatorname" if found[1].startswith("operatorname") else "text"
        return rf"\{name}{{{len(kept) - 1}}}"

    text = re.sub(r"\\(text|mathrm|mathit|mathbf|operatorname\*?)\s*\{([^{}]*)\}", keep, text)
    tokens = TOKEN.findall(text)
    body, rest = _row(tokens, 0, kept, ())
    if rest != len(tokens):
        raise ValueError(f"{tokens[rest]!r} is not expected in {latex!r}")
    return f"<math>{_group(body)}</math>"


def _group(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"<mrow>{''.join(parts)}</mrow>"


def _row(tokens: list[str], i: int, kept: list[str], until: tuple[str, ...]) -> tuple[list[str], int]:
    """Parts from token i to one of `until`, which is not taken."""
    parts: list[str] = []
    while i < len(tokens) and tokens[i] not in until:
        if tokens[i] == "}":
            raise ValueError("a brace is closed that was not opened")
        if tokens[i] in ("^", "_"):
            base = parts.pop() if parts else "<mrow></mrow>"
            part, i = _scripts(base, tokens, i, kept)
        else:
            part, i = _atom(tokens, i, kept)
        parts += [part] if part else []
    return parts, i


def _scripts(base: str, tokens: list[str], i: int, kept: list[str]) -> tuple[str, int]:
    found: dict[str, str] = {}
    while i < len(tokens) and tokens[i] in ("^", "_") and tokens[i] not in found:
        sign = tokens[i]
        found[sign], i = _atom(tokens, i + 1, kept)
    wide = any(f">{sign}<" in base for sign in "∑")
    if len(found) == 2:
        name = "munderover" if wide else "msubsup"
        return f"<{name}>{base}{found['_']}{found['^']}</{name}>", i
    name = {"_": "munder" if wide else "msub", "^": "mover" if wide else "msup"}[next(iter(found))]
    return f"<{name}>{base}{next(iter(found.values()))}</{name}>", i


def _atom(tokens: list[str], i: int, kept: list[str]) -> tuple[str, int]:
    if i >= len(tokens):
        raise ValueError("the formula ends too early")
    piece, i = tokens[i], i + 1
    if piece == "{":
        parts, i = _row(tokens, i, kept, ("}",))
        if i >= len(tokens):
            raise ValueError("a brace is not closed")
        return _group(parts) if parts else "<mrow></mrow>", i + 1
    if not piece.startswith("\\"):
        return _plain(piece), i
    name = piece[1:]
    if name == "frac":
        above, i = _atom(tokens, i, kept)
        below, i = _atom(tokens, i, kept)
        return f"<mfrac>{above}{below}</mfrac>", i
    if name == "sqrt":
        inner, i = _atom(tokens, i, kept)
        return f"<msqrt>{inner}</msqrt>", i
    if name in ACCENTS:
        inner, i = _atom(tokens, i, kept)
        return f'<mover accent="true">{inner}<mo>{ACCENTS[name]}</mo></mover>', i
    if name in ("text", "operatorname"):
        word, i = kept[int(tokens[i + 1])], i + 3
        return (f"<mtext>{escape(word)}</mtext>" if name == "text" else _function(word)), i
    if name == "begin":
        return _matrix(tokens, i, kept)
    return _named(name), i


def _plain(token: str) -> str:
    if token[0].isdigit():
        return f"<mn>{token}</mn>"
    if token.isalpha():
        return f"<mi>{token}</mi>"
    return f"<mo>{MINUS.get(token, escape(token))}</mo>"


def _named(name: str) -> str:
    if name in GREEK:
        return f"<mi>{GREEK[name]}</mi>"
    if name in SIGNS:
        return f"<mo>{SIGNS[name]}</mo>"
    if name in FUNCTIONS:
        return _function(name)
    if name in SPACES:
        return f'<mspace width="{SPACES[name]}"/>'
    if name in IGNORED:
        return ""
    if len(name) == 1 and not name.isalpha():  # \{, \|, \%
        return f"<mo>{escape(name)}</mo>"
    raise ValueError(rf"\{name} is not known here")


def _function(name: str) -> str:
    return f'<mi>{escape(name)}</mi><mspace width="0.1em"/>'


def _matrix(tokens: list[str], i: int, kept: list[str]) -> tuple[str, int]:
    r"""From behind \begin: {bmatrix} rows \end{bmatrix}."""
    close = tokens.index("}", i)
    i, rows, cells = close + 1, [], []
    while True:
        parts, i = _row(tokens, i, kept, ("&", r"\\", r"\end"))
        if i >= len(tokens):
            raise ValueError("a matrix is not ended")
        cells.append(f"<mtd>{_group(parts) if parts else ''}</mtd>")
        if tokens[i] != "&":
            rows.append(f"<mtr>{''.join(cells)}</mtr>")
            cells = []
        if tokens[i] == r"\end":
            return f"<mrow><mo>[</mo><mtable>{''.join(rows)}</mtable><mo>]</mo></mrow>", tokens.index("}", i) + 1
        i += 1
