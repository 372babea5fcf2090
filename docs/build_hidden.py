"""Write what is said of real recordings whose cause has been taken out of the catalogue: whether its law is found.

    python docs/build_hidden.py FOLDER

FOLDER contains the recordings by name (docs/real-recordings.md says where they are from). Each is diagnosed twice, with
the whole catalogue and without the effects that explain it; docs/measured/hidden_causes.txt is written.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from gimbalcal.diagnose import Diagnosis, diagnose
from gimbalcal.effects import CATALOGUE
from gimbalcal.pipeline import load


@dataclass(frozen=True)
class Case:
    """A recording, the effects that are hidden, what physics they are, and the effects of the model."""

    name: str
    hidden: tuple[str, ...]
    physics: str
    baseline: tuple[str, ...] = ()


DRIFT = ("gimbal_zero", "gimbal_zero_drift")
CASES = (
    Case("phd_2212", ("periodic_worm_error",), "worm, 598 s", DRIFT),
    Case("phd_0020", ("periodic_worm_error",), "worm, 598 s; best free period 608 s", DRIFT),
    Case("heq_0801_2", ("periodic_worm_error",), "worm, 479 s, of 2.1 arcsec", DRIFT),
    Case("mmtabs_20230702", (), "sin(azimuth) of a second encoder, which no catalogue has"),
    Case("mmt_20250326", ("refraction", "tube_flexure"), "cot(elevation) or cos(elevation)"),
    Case("kim2", ("gyro_g_sensitivity_rate",), "rate about x follows the force along x", ("gyro_bias",)),
    Case("navtemp", ("gyro_bias_temperature", "gyro_bias_temperature_squared", "gyro_bias_temperature_cubed",
                     "gyro_bias_drift"), "rates follow the temperature of a chamber, up to cubic", ("gyro_bias",)),
)  # fmt: skip


@contextmanager
def hidden(ids: Sequence[str]) -> Iterator[None]:
    """Take effects out of the catalogue and put them back."""
    taken = {i: CATALOGUE.pop(i) for i in ids}
    try:
        yield
    finally:
        CATALOGUE.update(taken)


def answer(d: Diagnosis) -> str:
    """What is named, with the laws, in one line."""
    named = [f"{f.effect}:{f.axis} {f.probability:.2f}" for f in d.findings]
    return f"{d.verdict}: {'; '.join([*named, *(f'{law.axis}: {law.expression}' for law in d.laws)]) or 'nothing'}"


def main() -> None:
    """Write both answers of each recording."""
    folder = Path(sys.argv[1])
    lines = ["with the whole catalogue, and without what explains the recording (in parentheses)"]
    for case in CASES:
        recordings = load([folder / case.name])
        lines += ["", f"{case.name}: {case.physics}", f"  {answer(diagnose(recordings, baseline=case.baseline))}"]
        if case.hidden:
            with hidden(case.hidden):
                without = answer(diagnose(recordings, baseline=case.baseline))
            lines.append(f"  ({', '.join(case.hidden)}) {without}")
    (Path(__file__).parent / "measured" / "hidden_causes.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
