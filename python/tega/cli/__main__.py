"""Run ``tega-teleop`` as ``python -m tega.cli``."""

from tega.cli.main import main

main()
