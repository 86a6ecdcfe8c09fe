"""``python -m guided_lgp.cli``."""

from guided_lgp.cli import main

main()
