"""What can be wrong with data, a model, a problem or a scenario.

Each error is also the builtin it specialises, so ``except ValueError`` keeps working.
"""


class KmpcError(Exception):
    """Base of every error this package raises on purpose."""


class DataError(KmpcError, ValueError):
    """A log or a dataset cannot be used: says what was expected, what came, and where."""


class ModelError(KmpcError, ValueError):
    """A model file or its matrices cannot be used."""


class ProblemError(KmpcError, ValueError):
    """A navigation problem, an obstacle or a controller option contradicts itself."""


class ScenarioError(KmpcError, ValueError):
    """A scenario file is wrong: names the file and the key."""
