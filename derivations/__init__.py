"""Every printed formula the package rests on, derived again from first principles and judged.

One subpackage per paper, one file per group of equations: prose, sympy, verdict. Nothing here uses `gimbalcal` to
derive; where the package holds the same law, its numbers are compared with the derivation afterwards.
`python -m derivations` prints the verdicts and writes `errata.json`.
"""
