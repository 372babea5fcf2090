"""Make data/xsens_positions from the two files of the imu_tk test data: one row of means per rest.

    python data/build_xsens_positions.py xsens_acc.mat xsens_gyro.mat

The files are bin/test_data/xsens_acc.mat and xsens_gyro.mat of github.com/Kyle-ak/imu_tk (BSD licence).
"""

from __future__ import annotations

import sys
from pathlib import Path

from gimbalcal.importers import import_files
from gimbalcal.recording import write

TITLE = "Xsens MTi, turned by hand"

ABOUT = """
Means over the rests of a real Xsens MTi inertial unit, turned by hand from rest to rest on a table.

Raw data: bin/test_data/xsens_acc.mat and xsens_gyro.mat of github.com/Kyle-ak/imu_tk, commit
7780270fb9a227c79323199303f23989e689a89d, (c) 2014 Alberto Pretto, BSD licence; described in Tedaldi, Pretto and
Menegatti, "A robust and easy to implement method for IMU calibration without external equipments", ICRA 2014.
sha256 of the raw files: {hashes}

The rests were found and averaged by this program, see gimbalcal/recording/detection.py; 100 samples a second.
Outputs are counts of the converter, so scale factors come out in count per g. [noise] is the scatter of one sample;
`weight` is the number of samples in a mean. No gimbal angles were measured: the unit calibrates by the norm alone.
The gyroscope means are the outputs at rest: offsets, with the Earth's rate below the noise.

Made by: python data/build_xsens_positions.py xsens_acc.mat xsens_gyro.mat
(the same as: gimbalcal import imu-tk xsens_acc.mat xsens_gyro.mat --set means=yes --out data/xsens_positions)
"""


def main(files: list[str]) -> None:
    """Write the recording into the folder of this script."""
    means = import_files("imu-tk", files, {"means": "yes", "title": TITLE})
    hashes = ", ".join(f"{source.path} {source.sha256}" for source in means.source)
    write(means, Path(__file__).parent / "xsens_positions", comment=ABOUT.format(hashes=hashes).strip().splitlines())


if __name__ == "__main__":
    main(sys.argv[1:])
