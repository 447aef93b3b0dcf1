"""From driving to a bilinear Koopman model."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.calibration import fit_noise, with_noise
from kmpc_lite.learn.checks import NEVER_MOVES
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.lag import aligned, mean_delay
from kmpc_lite.learn.regression import Accumulator, Method, wants_symmetry
from kmpc_lite.model.dictionary import Dictionary, InputHistoryDictionary, UnicycleDictionary
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import UNMODELLED_DELAY

Lags = Literal["auto"] | Sequence[int] | None
SLOW, TURNING, SPOT, FEWEST, FOLLOWS = 0.1, 0.3, 1.0, 3, 0.2
"""Share of the largest speed below which a robot counts as standing; of the largest turn rate above
which it is commanded to turn; length of a stretch that shows a turn on the spot [s]; stretches that
are needed; share of its usual turn gain below which a robot does not turn on the spot."""


def refuse_car_like(dataset: Dataset) -> None:
    """Raise DataError for a robot that is told to turn on the spot and does not, however late."""
    delay = mean_delay(dataset)
    answered = aligned(dataset, delay) if delay else dataset
    length = max(1, round(SPOT / dataset.dt))
    states, _, inputs = answered.every_piece(length, stride=length)
    asked, turned = inputs[..., -1].sum(axis=1) * dataset.dt, states[:, -1, 2] - states[:, 0, 2]
    speeds = np.abs(inputs[..., 0]).max(axis=1)
    v_max = speeds.max(initial=0.0)
    turning = np.abs(asked) > TURNING * np.abs(asked).max(initial=0.0)
    on_the_spot = turning & (speeds < SLOW * v_max)
    driving = turning & (speeds > 3.0 * SLOW * v_max)
    if min(on_the_spot.sum(), driving.sum()) < FEWEST:
        return
    spot, usual = (
        float(asked[rows] @ turned[rows] / (asked[rows] @ asked[rows]))
        for rows in (on_the_spot, driving)
    )
    if abs(usual) > 0.05 and abs(spot) < FOLLOWS * abs(usual):
        raise DataError(
            "this robot does not turn on the spot: commanded to, it turns by "
            f"{spot:.2f} of the command while it stands, {usual:.2f} while it drives. It is a "
            "car: its log needs the steering angle (column steering) instead of a turn rate"
        )


def fit(
    dataset: Dataset,
    dictionary: Dictionary | None = None,
    method: Method = "integral",
    ridge: float = 0.0,
    noise: bool = True,
    symmetric: bool | None = None,
    lags: Lags = None,
    ramps: bool = True,
    whole: Dataset | None = None,
    stay: Collection[int] = (),
) -> KoopmanModel:
    """Learn a bilinear Koopman model from driving.

    Parameters
    ----------
    dataset : Dataset
        Evenly sampled episodes.
    dictionary : Dictionary, optional
        The paper's `UnicycleDictionary` if not given.
    method : {"integral", "edmdc"}
        ``"integral"`` fits the generator in weak form, twice, the second time with the path between
        samples bent by the first result. ``"edmdc"`` is the paper's one-step regression (eq. 8).
    ridge : float
        Share of the scaled Gram matrix's diagonal that is added to it.
    noise : bool
        Whether to learn the covariance of the residuals too (one more pass).
    symmetric : bool, optional
        Whether the robot moves alike wherever it stands and whichever way it faces, and stands
        still at zero command: two rows for the motion and one for the turn instead of a matrix for
        every lifted coordinate. True for ``"integral"`` if not given, as far as the dictionary
        holds 1, cos(theta) and sin(theta); ``"edmdc"`` is never symmetric.
    lags : "auto" or sequence of int, optional
        ``"auto"`` finds out what the log supports, in each direction: how late the robot answers,
        how it slips, or nothing at all (`learn.selection`); then the robot that obeys its commands
        exactly stays. Ages [periods] of the commands that act, the present one being 0, have
        weights of their own in every direction, as with an `InputHistoryDictionary`. Without any,
        commands are paired with the motion that comes of them later, and how much later is kept
        beside the model: the controller brings poses forward by it.
    ramps : bool
        Whether, together with lags that are chosen, ramps are looked for by which the robot changes
        its speeds (`learn.ramps`): then the model is one of commands as they let them through, and
        the controller asks for no faster changes.
    whole : Dataset, optional
        The log of which `dataset` is a part: lags and terms are chosen on all of it, and fitted to
        `dataset`.
    stay : collection of int
        Directions, 0 along, 1 across, 2 in heading, that stay those of the nominal robot where lags
        are chosen.

    Returns
    -------
    KoopmanModel
        Its `info` tells method, samples, rank and condition.

    Raises
    ------
    DataError
        If the data cannot determine a model: too few samples, a constant input. For
        ``symmetric=True`` with a dictionary or a method that cannot be.

    Examples
    --------
    >>> from kmpc_lab import DifferentialDrive, generate_dataset
    >>> data = generate_dataset(DifferentialDrive(), episodes=10, steps=100, dt=0.1, seed=0)
    >>> fit(data).H.reshape(3, 2, 6).round(3)[2] + 0.0
    array([[0., 0., 0., 0., 0., 0.],
           [1., 0., 0., 0., 0., 0.]])
    """
    if not isinstance(dataset, Dataset):
        raise DataError(
            f"dataset: expected a Dataset, got {type(dataset).__name__}; "
            "Dataset.load(path) reads a log"
        )
    lifting = UnicycleDictionary(dataset.commands) if dictionary is None else dictionary
    if not hasattr(lifting, "lift"):
        raise DataError(f"dictionary: expected one like UnicycleDictionary(), got {lifting!r:.60}")
    if lifting.commands != dataset.commands:
        raise DataError(
            f"dictionary: expected one for commands of {dataset.commands} numbers, as those of "
            f"the log, got {lifting.commands}; {type(lifting).__name__}(commands=...) makes one"
        )
    symmetric = wants_symmetry(symmetric, method, lifting)
    if lags == "auto":
        if not symmetric or ridge or lifting.history:
            raise DataError(
                "lags='auto' goes with the symmetric integral fit, without a ridge and with a "
                "dictionary that knows no history itself"
            )
        return _fit_chosen(dataset, lifting, noise, ramps, whole, stay)
    if lags is not None:
        lifting = InputHistoryDictionary(lifting, tuple(lags))
    delay = mean_delay(dataset) if symmetric and not lifting.history else 0.0
    seen = aligned(dataset, delay) if delay else dataset
    model: KoopmanModel | None = None
    for _ in range(2 if method == "integral" else 1):
        accumulator = Accumulator(lifting, seen.dt, method, midpoint=model)
        accumulator.add(seen)
        model = accumulator.solve(ridge, symmetric)
    assert model is not None
    if delay:
        model = replace(model, info={**model.info, UNMODELLED_DELAY: delay})
    if not noise:
        return model
    # a robot that coasts shows errors at rest that are no noise of its poses, and errors of one
    # period do not tell those that last
    lasts = delay or (symmetric and model.history)
    return with_noise(model, seen) if lasts else replace(model, noise_model=fit_noise(model, seen))


def _fit_chosen(
    dataset: Dataset,
    base: Dictionary,
    noise: bool,
    ramps: bool,
    whole: Dataset | None,
    stay: Collection[int],
) -> KoopmanModel:
    """Fit what the log supports, behind the ramps that it shows."""
    # here, for a robot that drives needs none of it
    from kmpc_lite.learn.ramps import find_ramps, let_through, with_ramps
    from kmpc_lite.learn.selection import build_model, select

    if ramps:
        found = find_ramps(dataset)
        log = None if whole is None else let_through(whole, found)
        model = _fit_chosen(let_through(dataset, found), base, noise, False, log, stay)
        return with_ramps(model, dataset, found)
    moved = max(float(np.abs(np.diff(e.states, axis=0)).max(initial=0.0)) for e in dataset.episodes)
    if moved <= 1e-9 < float(np.abs(dataset.inputs).max(initial=0.0)):
        raise DataError(NEVER_MOVES)
    refuse_car_like(dataset)
    model = build_model(select(dataset, whole, stay), base, dataset.dt)
    return with_noise(model, dataset) if noise else model
