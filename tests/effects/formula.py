r"""Reads the formula of an effect's card and evaluates it, so that what is printed is what is computed.

The subset of LaTeX that the cards use: + - / ^, products by juxtaposition, \times, \frac, \sqrt, elementary
functions, |x|, sums over an index, integrals over time, Iverson's bracket [t \geq t_0], vectors (a, b, c), matrices.
"""

import re
from collections.abc import Callable, Mapping

import numpy as np

from gimbalcal.effects import Effect, Stimulus
from gimbalcal.number import Array
from tests.effects.symbols import Matrix, Scope, Value, area, late, meaning

TOKEN = re.compile(r"\\operatorname\{\w+\}|\\[A-Za-z]+|\d+(?:\.\d+)?|[A-Za-z]|[-+*/^_=|&(){}\[\],.']|\\\\")
FUNCTIONS: Mapping[str, Callable[..., Value]] = {
    r"\sin": np.sin, r"\cos": np.cos, r"\sqrt": np.sqrt, r"\operatorname{sign}": np.sign, r"\min": np.minimum,
    r"\max": np.maximum, r"\area": area, r"\late": late,
}  # fmt: skip
ACCENTS = {r"\dot": "dot ", r"\bar": "bar ", r"\Delta": "Delta ", r"\delta": "delta "}
SPELLED = {"vartheta": "theta", "varepsilon": "epsilon", "varphi": "phi"}
IVERSON: Mapping[str, Callable[[Array, Array], Array]] = {r"\geq": np.greater_equal, "=": np.equal}


def card_formula(effect: type[Effect]) -> str:
    """The formula of a card: what stands, indented, behind `.. math::`."""
    found = re.search(r"\.\. math::(.*?)(?:\n\s*\n|\Z)", effect.__doc__ or "", re.DOTALL)
    assert found, f"{effect.id} has no formula"
    return " ".join(found[1].split())


def evaluated(text: str, effect: Effect, s: Stimulus, names: Mapping[str, str]) -> Array:
    """What the formula says the effect adds: (n, c), or (n, k, 3) for a tilt of each axis."""
    text = text.rsplit(r"\Rightarrow", maxsplit=1)[-1].replace("(t)", "")
    text = re.sub(r"(\d+)\\,\\mathrm\{h\}", lambda hours: f"{3600 * int(hours[1])}", text)
    text = re.sub(
        r"\\int_0\^\\infty (.*?)\(t - u\)(.*?) ?\\frac\{e\^\{-u / \\tau\}\}\{\\tau\} du", r"\\late(\1\2)", text
    )
    text = re.sub(r"\\int (.*?) dt", r"\\area(\1)", re.sub(r"\\[,;!]|\\left|\\right(?!arrow)|\\text\{.*?\}", " ", text))
    first, *others = (clause.rstrip(" .,") for clause in re.split(r",?\s*\\q?quad", text))
    defined = {"".join(o.split("=")[0].split()).lstrip("\\"): _later(o.split("=")[-1]) for o in others if "=" in o}
    left, right = first.split("=")[0], _last_member(first)
    scope = Scope(s, effect, names, defined, {})
    if left.strip() in ("C_p^a", "C_p^g"):
        acts = s.force if left.strip() == "C_p^a" else s.rate
        return np.asarray(read(right)(scope) @ acts - acts)
    if not re.search(r"_\{?i", left):
        return _all_rows(read(right)(scope), s)
    channels = range(s.readout.shape[1] if re.search(r"\\theta|T_i", left) else 3)
    parts = [read(right)(scope.at(i=i, j=(i + 1) % 3, k=(i + 2) % 3)) for i in channels]
    if left.strip() == "T_i":
        return np.stack([np.broadcast_to(p, (len(s.time), 3)) for p in parts], axis=1)
    return np.concatenate([_all_rows(p, s) for p in parts], 1)


def _later(text: str) -> Callable[[Scope], Value]:
    """A definition, read when it is needed: some only explain."""

    def defined(e: Scope) -> Value:
        return read(text)(e)

    return defined


def _all_rows(value: Value, s: Stimulus) -> Array:
    """A constant stands for every row."""
    value = np.atleast_1d(value)
    return np.asarray(value if value.ndim > 1 else np.tile(value, (len(s.time), 1)))


def _last_member(clause: str) -> str:
    """What stands behind the last equals sign that is in no bracket."""
    depth, cut = 0, 0
    for place, character in enumerate(clause):
        depth += (character in "[{(") - (character in "]})")
        cut = place + 1 if character == "=" and depth == 0 else cut
    return clause[cut:]


def read(text: str) -> Callable[[Scope], Value]:
    """The meaning of an expression, as a function of what its symbols mean."""
    reader = Reader(TOKEN.findall(text))
    made = reader.total()
    assert not reader.tokens[reader.at :], f"cannot read {' '.join(reader.tokens[reader.at :])!r} of {text!r}"
    return made


class Reader:
    """Recursive descent over the tokens."""

    def __init__(self, tokens: list[str]) -> None:
        self.tokens, self.at, self.bars = tokens, 0, 0  # bars: how many |...| are open

    def next(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def take(self, expected: str = "") -> str:
        token = self.next()
        assert token, f"{expected!r} expected where the formula ends"
        assert token == (expected or token), f"{expected!r} expected, {token!r} found"
        self.at += 1
        return token

    def total(self) -> Callable[[Scope], Value]:
        signs, terms = [], []
        while not terms or self.next() in {"+", "-"}:
            signs.append(-1.0 if self.next() == "-" else 1.0)
            if self.next() in {"+", "-"}:
                self.take()
            terms.append(self.product())
        if len(terms) == 1 and signs[0] == 1:
            return terms[0]
        return lambda e: sum((sign * term(e) for sign, term in zip(signs, terms, strict=True)), start=0.0)

    def product(self) -> Callable[[Scope], Value]:
        made = self.power()
        while (token := self.next()) and token not in {"+", "-", ",", ")", "}", "]", "&", r"\\", r"\end", *IVERSON}:
            if token == "|" and self.bars:
                break
            if token in {"/", r"\times"}:
                self.take()
            made = _joined(token, made, self.power())
        return made

    def power(self) -> Callable[[Scope], Value]:
        base = self.atom()
        if self.next() == "^":
            self.take()
            exponent = self.group()
            return lambda e: base(e) ** exponent(e)
        return base

    def group(self) -> Callable[[Scope], Value]:
        """{...}, or a single token."""
        if self.next() != "{":
            return self.atom()
        self.take()
        made = self.total()
        self.take("}")
        return made

    def atom(self) -> Callable[[Scope], Value]:
        token = self.next()
        if token.isdigit():
            value = float(self.take())
            return lambda e: value
        if token == r"\sum":
            return self.sum()
        if token == r"\begin":
            return self.matrix()
        if token in {"|", "(", "["}:
            return self.bracket()
        if token == r"\frac":
            self.take()
            above, below = self.group(), self.group()
            return lambda e: above(e) / below(e)
        if token in FUNCTIONS:
            return self.function()
        if token == "e" and self.tokens[self.at + 1] == "^":
            self.at += 2
            exponent = self.group()
            return lambda e: np.exp(exponent(e))
        return self.symbol()

    def function(self) -> Callable[[Scope], Value]:
        """sin(...), sqrt{...}, or sin of the symbols and numbers that follow."""
        call = FUNCTIONS[self.take()]
        if self.next() in {"(", "{"}:
            arguments = self.arguments()
            return lambda e: call(*([e.s] if call in {area, late} else []), *(a(e) for a in arguments), *_tau(call, e))
        inside = self.atom()
        while re.fullmatch(r"[A-Za-z0-9]|\\[a-z]+(?<!sin)(?<!cos)(?<!times)", self.next()):
            inside = _joined("", inside, self.atom())
        return lambda e: call(inside(e))

    def arguments(self) -> list[Callable[[Scope], Value]]:
        closing = {"(": ")", "{": "}"}[self.take()]
        made = [self.total()]
        while self.next() == ",":
            self.take()
            made.append(self.total())
        self.take(closing)
        return made

    def bracket(self) -> Callable[[Scope], Value]:
        if self.next() == "(":
            parts = self.arguments()
            return parts[0] if len(parts) == 1 else lambda e: _columns([p(e) for p in parts], e)
        closing = {"|": "|", "[": "]"}[self.take()]
        self.bars += closing == "|"
        inside = self.total()
        self.bars -= closing == "|"
        if (compare := IVERSON.get(self.next())) is not None:
            self.take()
            other = self.total()
            self.take(closing)
            return lambda e: compare(inside(e), other(e)).astype(float)
        self.take(closing)
        if closing == "]":
            self.take("_")
            channel = self.take()
            return lambda e: inside(e)[:, [e.index[channel]]]
        return lambda e: np.abs(inside(e))

    def matrix(self) -> Callable[[Scope], Value]:
        for expected in (r"\begin", "{", *"bmatrix", "}"):
            self.take(expected)
        rows = [[self.total()]]
        while self.next() != r"\end":
            if self.take() == "&":
                rows[-1].append(self.total())
            else:
                rows.append([self.total()])
        for expected in (r"\end", "{", *"bmatrix", "}"):
            self.take(expected)
        return lambda e: Matrix(np.array([[np.ravel(entry(e))[0] for entry in row] for row in rows]))

    def sum(self) -> Callable[[Scope], Value]:
        r"""\sum_j, \sum_{j \ne i}, \sum_{n=4}^{7}."""
        self.take()
        self.take("_")
        bound = self.raw()
        index, other = bound[0], (bound[-1] if r"\ne" in bound else "")
        last = None
        if self.next() == "^":
            self.take()
            last = int("".join(self.raw()))
        first = int(bound[2]) if last is not None else 0
        body = self.product()

        def total(e: Scope) -> Value:
            run = range(first, (last if last is not None else 2) + 1)
            return sum(body(e.at(**{index: n})) for n in run if not other or n != e.index[other])

        return total

    def raw(self) -> list[str]:
        """The tokens of a sub- or superscript."""
        if self.next() != "{":
            return [self.take()]
        self.take()
        out = []
        while self.next() != "}":
            out.append(self.take())
        self.take()
        return out

    def symbol(self) -> Callable[[Scope], Value]:
        name = ""
        while self.next() in ACCENTS and re.match(r"\\?[A-Za-z]", self.tokens[self.at + 1]):
            name += ACCENTS[self.take()]
        token = self.take().lstrip("\\")
        name += SPELLED.get(token, token)
        below, above = "", ""
        if self.next() == "_":
            self.take()
            below = "".join(self.raw())
        if self.next() == "^" and re.match(r"\{?\(|[a-z]", "".join(self.tokens[self.at + 1 : self.at + 3])):
            self.take()
            above = "^" + "".join(self.raw())
        if name in {"R", "P"} and self.next() == "(":  # a small rotation is its vector; a Legendre polynomial
            arguments = self.arguments()
            if name == "R":
                return lambda e: _columns([a(e) for a in arguments], e)
            return lambda e: np.polynomial.Legendre.basis(e.index[below])(arguments[0](e))
        return lambda e: meaning(name, below, above, e)


def _joined(token: str, a: Callable[[Scope], Value], b: Callable[[Scope], Value]) -> Callable[[Scope], Value]:
    if token == "/":
        return lambda e: a(e) / b(e)
    if token == r"\times":
        return lambda e: np.cross(*np.broadcast_arrays(np.asarray(a(e)), np.asarray(b(e))))
    return lambda e: a(e) @ b(e) if isinstance(a(e), Matrix) else a(e) * b(e)


def _columns(parts: list[Value], e: Scope) -> Array:
    n = len(e.s.time)
    return np.column_stack([np.broadcast_to(np.asarray(p, dtype=float).reshape(-1, 1), (n, 1)) for p in parts])


def _tau(call: Callable[..., Value], e: Scope) -> list[Value]:
    return [vars(e.effect)["tau"]] if call is late else []
