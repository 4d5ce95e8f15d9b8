"""`python -m vsensor.cli`: what the program `vsensor` runs."""

import sys

from vsensor.cli import main

sys.exit(main())
