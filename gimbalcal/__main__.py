"""``python -m gimbalcal`` is the command line."""

from gimbalcal.cli import main

main()
