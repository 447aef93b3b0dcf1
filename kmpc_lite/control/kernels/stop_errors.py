"""What the errors of single periods add up to while a robot drives, at each period (..., T).

Variances are those of one period by v^2 and by omega^2: `whole`, of which `lasting` is alike in all
periods. Errors of single periods add up by their squares and are as rare as the step risk; those
that last add up as they are, with the risk of a plan: they are there all the time.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array


def added_up(rates: Array, whole: Array, lasting: Array, rare: float, usual: float) -> Array:
    """Quantile of the sum of errors at speeds and turn rates (2, ..., T) [m or rad].

    Parameters
    ----------
    rates : ndarray
        (2, ..., T) speeds and turn rates of each period [m/s, rad/s].
    whole, lasting : ndarray
        (2,) variances of one period.
    rare, usual : float
        Standard deviations that are kept of single errors, and of those that last.
    """
    single, summed = np.zeros(rates.shape[1:]), np.zeros(rates.shape[1:])
    for rate, each, lasts in zip(rates, whole.tolist(), lasting.tolist(), strict=True):
        squares, white = rate * rate, max(each - lasts, 0.0)
        single += rare**2 * each * squares
        summed += rare**2 * white * np.cumsum(squares, axis=-1)
        if lasts:
            summed += usual**2 * lasts * np.cumsum(rate, axis=-1) ** 2
    worst = np.maximum.accumulate(single, axis=-1)
    errors: Array = np.sqrt(np.maximum(worst, summed))
    return errors


def led_aside(
    rates: Array, dt: float, whole: Array, lasting: Array, rare: float, usual: float
) -> Array:
    """Quantile of what headings that are off lead aside over all that is driven after [m].

    Arguments as of `added_up`, with variances of the heading; `dt` is the period [s].
    """
    driven = rates[0] * dt
    ends = np.cumsum(driven, axis=-1)
    begins, squared = ends - driven, np.zeros_like(ends)
    for rate, each, lasts in zip(rates, whole.tolist(), lasting.tolist(), strict=True):
        white = rare**2 * max(each - lasts, 0.0) * rate * rate
        if white.any():
            # the sum of what comes from each period, by the squared way from its begin on
            constant, linear, square = (np.cumsum(white * begins**n, axis=-1) for n in range(3))
            squared += ends * (ends * constant - 2.0 * linear) + square
        if lasts:
            way = ends * np.cumsum(rate, axis=-1) - np.cumsum(rate * begins, axis=-1)
            squared += usual**2 * lasts * way * way
    aside: Array = np.sqrt(np.maximum(squared, 0.0))
    return aside


def stop_errors(
    distances: Array,
    turns: Array,
    dt: float,
    position: Array,
    heading: Array,
    rare: float,
    usual: float,
    reach: float,
) -> Array:
    """Errors (..., T) at the end of each period of what is driven and turned [m].

    Parameters
    ----------
    distances, turns : ndarray
        What is driven [m] and turned [rad] in each period, (..., T).
    dt : float
        Period [s].
    position, heading : ndarray
        (4,) variances of one period by v^2 and by omega^2, then what lasts of them.
    rare, usual : float
        As of `added_up`.
    reach : float
        How far the outline lies from the pose [m].
    """
    rates = np.abs(np.stack([distances, turns])) / dt
    own = added_up(rates, position[:2], position[2:], rare, usual)
    errors = np.hypot(own, led_aside(rates, dt, heading[:2], heading[2:], rare, usual))
    if reach:
        errors += reach * added_up(rates, heading[:2], heading[2:], rare, usual)
    return errors
