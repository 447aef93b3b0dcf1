"""Replay golden drives and tell, drive by drive, how far the answers are from the recorded ones."""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from golden_file import CODES, FILE, STATUSES, deviation, first_difference, load
from golden_session import replay

import kmpc_lite as kl


def main() -> int:
    """Replay."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, nargs="*", help="their numbers (default: all)")
    parser.add_argument("--kind", default="", help="only drives whose kind has this text in it")
    parser.add_argument(
        "--file", type=Path, default=FILE, help="recorded drives (default: %(default)s)"
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="show only drives that differ")
    parser.add_argument(
        "-x", "--first", action="store_true", help="end at the first drive that differs"
    )
    given = parser.parse_args()
    models, drives, about = load(given.file)
    chosen = [
        d
        for d in drives
        if (not given.drives or d.number in given.drives) and given.kind in d.setup["kind"]
    ]
    sys.stdout.write(f"recorded: {about}\nreplayed: {Path(kl.__file__).parent}\n")
    whole, red, begun, statuses = hashlib.sha256(), [], time.process_time(), Counter()
    for drive in chosen:
        try:
            values, codes = replay(drive, models)
        except (
            Exception
        ) as error:  # whatever a change breaks is told, and the next drive is replayed
            red.append(drive.number)
            sys.stdout.write(
                f"{drive.number:4d} {drive.setup['kind']:42} {type(error).__name__}: {error}\n"
            )
            if given.first:
                break
            continue
        whole.update(values.tobytes() + codes.tobytes())
        statuses.update(STATUSES[c] for c in codes[:, CODES.index("status")])
        difference = first_difference(drive, values, codes)
        if difference is not None:
            red.append(drive.number)
        if difference is not None or not given.quiet:
            worst = float(np.max(deviation(drive, values), initial=0.0))
            said = "as recorded" if difference is None else f"step {difference[0]}: {difference[1]}"
            name = f"{drive.number:4d} {drive.setup['kind']:42} {len(drive.poses):3d} steps"
            sys.stdout.write(f"{name}, at most {worst:.1e} off; {said}\n")
        if difference is not None and given.first:
            break
    seconds = time.process_time() - begun
    sys.stdout.write(f"{dict(statuses)}; {seconds:.1f} s; answers {whole.hexdigest()[:16]}\n")
    sys.stdout.write(f"{len(red)} of {len(chosen)} drives differ\n")
    return 1 if red else 0


if __name__ == "__main__":
    sys.exit(main())
