"""Measurements as functions of the effects in the model: residuals, their derivatives and what their noise may be.

A recording is checked once and becomes views; estimators and the diagnosis take these, and know no recordings, kinds of
recordings, columns or files.
"""
