"""Run ``tega-teleop`` as ``python -m tega.ui.cli``."""

from tega.ui.cli.main import main

main()
