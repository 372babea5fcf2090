"""Where the project and the recordings that ship with it are."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "data"
DEVICE, STATIC = DATA / "space_stable_18", DATA / "space_stable_static"
CONCEALED, XSENS = DATA / "space_stable_concealed", DATA / "xsens_positions"
REAL = ROOT.parent / "shared" / "data"  # recordings of others, where they are at hand
