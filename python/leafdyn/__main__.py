"""``python -m leafdyn``: the command line program."""

import sys

from ._program import main

sys.exit(main())
