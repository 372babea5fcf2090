"""Measurements as functions of the effects in the model: residuals, their derivatives and what their noise may be.

A recording is checked once and becomes views. Here its rows are cut into dwells, turns between them, slews, stretches
of a table, or stars; estimators and the diagnosis take views, and know no recordings, kinds of recordings, columns or
files.
"""
