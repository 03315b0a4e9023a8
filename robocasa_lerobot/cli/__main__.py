"""`python -m robocasa_lerobot.cli`."""

import sys

from robocasa_lerobot.cli import main

if __name__ == "__main__":
    sys.exit(main())
