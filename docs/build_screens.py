"""Take pictures of the pages that the documents show: run their commands and photograph the result in a browser.

    python docs/build_screens.py FOLDER [NAME ...]

FOLDER holds the real recordings, as for build_real.py; a browser (Chromium) has to be on the path. Each picture is the
top of a page at the width of a desk.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).parent
DATA = DOCS.parent / "data"
LOG = "mikoff_mpu9150/imu0.log"
SCREENS = {  # picture: the commands, the page, and the size of the window
    "report.png": (
        [["calibrate", str(DATA / "space_stable_18"), str(DATA / "space_stable_static"), "--out", "fused"]],
        "fused/report.html", (1280, 1040),
    ),
    "diagnosis.png": (
        [["diagnose", str(DATA / "space_stable_concealed"), "--out", "diagnosis"]],
        "diagnosis/report.html", (1280, 1040),
    ),
    "pictures/tutorial_rests.png": (
        [["new", "{log}", "--rate", "100", "--out", "imu"]], "imu/rests.html", (1000, 590),
    ),
    "pictures/noise.png": (
        [["import", "mikoff", "{log}", "--out", "imu"], ["noise", "imu", "--out", "noise"]],
        "noise/report.html", (1000, 760),
    ),
}  # fmt: skip


def main(recordings: Path, names: list[str]) -> None:
    """Take the named pictures, or all."""
    browser = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if browser is None:
        raise SystemExit("no chromium on the path")
    for name in names or SCREENS:
        commands, page, (wide, high) = SCREENS[name]
        with tempfile.TemporaryDirectory() as folder:
            for words in commands:
                arguments = [w.format(log=(recordings / LOG).resolve()) for w in words]
                done = subprocess.run(  # noqa: S603  the commands are those above
                    [sys.executable, "-m", "gimbalcal", *arguments, "--quiet"], cwd=folder, check=False
                )
                if done.returncode > 1:
                    raise SystemExit(f"gimbalcal {' '.join(arguments)} ended with status {done.returncode}")
            subprocess.run(  # noqa: S603
                [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
                 f"--user-data-dir={folder}/b", f"--window-size={wide},{high}", f"--screenshot={DOCS / name}",
                 (Path(folder) / page).as_uri()],
                check=True, capture_output=True,
            )  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
