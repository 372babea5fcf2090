"""A loop that Python does itself at first: plain numbers, as many rows as it is given, and then the machine."""

import numpy as np

from gimbalcal.compiled import Compiled


def doubled(x, out):
    for k in range(len(x)):
        out[k, 0] = 2 * x[k]
    return type(x[0])


def test_rows_are_counted_until_the_machine_is_worth_its_loading(monkeypatch):
    loop, out = Compiled(doubled, patience=10), np.zeros((12, 1))
    monkeypatch.setattr(loop, "made", lambda: lambda *given: "machine")
    assert loop(np.arange(6.0), out) is float  # and no number of numpy's, which are five times slower
    assert out[5, 0] == 10.0
    assert loop(np.arange(5.0), out) == "machine"
    assert loop(np.arange(4.0), out) is float
    assert loop(np.arange(1.0), out) == "machine"


def test_without_patience_the_machine_is_first(monkeypatch):
    loop = Compiled(doubled)
    monkeypatch.setattr(loop, "made", lambda: lambda *given: "machine")
    assert loop(2.0) == "machine"
