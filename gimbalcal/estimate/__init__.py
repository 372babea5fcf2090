"""Estimators: which views of a recording a method fits, in which noise, beside which nuisances, and what that says.

Residuals and how rows are cut into dwells, turns and stretches are those of `gimbalcal.views`.
"""
