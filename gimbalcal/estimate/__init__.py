"""Estimators: which views of a recording a method fits, with which noise and nuisances, and the result.

Residuals and how rows are cut into dwells, turns and stretches are those of `gimbalcal.views`.
"""
