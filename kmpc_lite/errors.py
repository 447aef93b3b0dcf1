"""What can be wrong with data, a model, a problem or a scenario.

Each error is also the builtin it specialises, so ``except ValueError`` keeps working.
"""

import difflib
from collections.abc import Iterable


def one_line(text: str) -> str:
    r"""Text with everything escaped that would break a line, or a terminal.

    Names that a file holds are part of messages.

    >>> one_line("vehicle\nlocal")
    'vehicle\\nlocal'
    """
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class KmpcError(Exception):
    """Base of every error this package raises on purpose: one line."""

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))


class DataError(KmpcError, ValueError):
    """A log or a dataset cannot be used: says what was expected, what came, and where."""


class ModelError(KmpcError, ValueError):
    """A model file or its matrices cannot be used."""


class ProblemError(KmpcError, ValueError):
    """A navigation problem, an obstacle or a controller option contradicts itself."""


class ScenarioError(KmpcError, ValueError):
    """A scenario file is wrong: names the file and the key."""


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """Name what is spelled nearly like `word`, to be put behind a message; or nothing.

    >>> did_you_mean("four_circle_1", ["four_circles_1", "mehrez"])
    "; did you mean 'four_circles_1'?"
    >>> did_you_mean("moon", ["four_circles_1", "mehrez"])
    ''
    """
    near = difflib.get_close_matches(word, list(names), n=1, cutoff=0.7)
    return f"; did you mean {near[0]!r}?" if near else ""
