"""``python -m tautscope``: the command line."""

import sys

from tautscope.cli import main

if __name__ == "__main__":
    sys.exit(main())
