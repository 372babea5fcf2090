"""Errors of a navigator with and without a calibration."""

import sys

from gimbalcal import CalledPackage

sys.modules[__name__].__class__ = CalledPackage
