"""kmpc: learn a robot and drive it; with kmpc-lab, simulate, study and show it, too.

Bad input ends in one line on standard error and exit status 2, or in ``{"error": ...}`` on standard
output with ``--json``; Ctrl-C ends in status 130.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Sequence

# one BLAS thread each: more only get in each other's way; NumPy, and worker processes, read this
# when they start
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from kmpc_lite.cli.command import (  # noqa: E402  # noqa: E402
    UsageError,
    build_parser,
    clear_line,
    known_commands,
    missing_extra,
    paint,
)
from kmpc_lite.errors import KmpcError  # noqa: E402

LONGEST_LINE = 1000  # longest error message, in characters
BAD_INPUT, INTERRUPTED, NOBODY_READS = 2, 130, 141


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit status.

    `arguments`: command line without the program's name; the process's own if not given.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    if "--json" in words and sys.stdout and sys.stdout is sys.__stdout__:
        # what libraries in C print is no JSON: OSQP does where Ctrl-C comes while it solves
        sys.stdout = os.fdopen(os.dup(1), "w")
        os.dup2(2, 1)
    told = _Complaint("--json" in words)
    errors: tuple[type[Exception], ...] = (KmpcError,)
    warnings.showwarning = lambda text, *_: print(f"kmpc: warning: {text}", file=sys.stderr)
    try:
        try:
            options = build_parser(known_commands(), words).parse_args(words)
            errors = (*errors, *options.errors)
            status: int = options.run(options)
            return status
        finally:
            # here a reader that has left can still be handled; at the end of Python it cannot
            print(end="", flush=True)
    except UsageError as error:
        return told(str(error), prog=error.prog)
    except BrokenPipeError:
        # whoever read the output has left; what is still buffered must not fail a second time
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOBODY_READS
    except errors as error:
        return told(str(error))
    except ModuleNotFoundError as error:
        if (text := missing_extra(error)) is None:
            raise
        return told(text)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return told(f"{where}{error.strerror or error}")
    except KeyboardInterrupt:
        return told("stopped", INTERRUPTED)


class _Complaint:
    """Tells what went wrong, to people or to machines."""

    def __init__(self, machines: bool) -> None:
        self._machines = machines

    def __call__(self, text: str, status: int = BAD_INPUT, prog: str = "kmpc") -> int:
        """Tell it in one line and return the exit status."""
        # of what a file holds, some may be many pages, or meant for the terminal
        text = "".join(c if c.isprintable() else "?" for c in " ".join(text.split("\n")))
        text = text if len(text) <= LONGEST_LINE else f"{text[: LONGEST_LINE - 3]}..."
        clear_line(sys.stderr)
        if self._machines:
            print(json.dumps({"error": text}))
        else:
            print(f"{paint(f'{prog}:', 'red', sys.stderr)} {text}", file=sys.stderr)
        return status


if __name__ == "__main__":
    sys.exit(main())
