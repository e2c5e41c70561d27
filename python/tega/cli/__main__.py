"""``python -m tega.cli``: the same as ``tega-teleop``."""

from tega.cli.main import main

main()
