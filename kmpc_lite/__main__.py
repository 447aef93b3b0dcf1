"""`python -m kmpc_lite` is `kmpc`."""

import sys

from kmpc_lite.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
