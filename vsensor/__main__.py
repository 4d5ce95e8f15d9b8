"""`python -m vsensor`: the command line where no `vsensor` program is on the path."""

import sys

from vsensor.cli import main

sys.exit(main())
