"""`kmpc fit`: learn a model from logs, check it on what it has not seen, write it."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import kmpc_lite as kl
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.files import keep_inputs
from kmpc_lite.cli.log_options import add_force, add_log_options, read_options
from kmpc_lite.defaults import SHORTEST_PERIOD

if TYPE_CHECKING:
    pass

DICTIONARIES = {
    "unicycle": "the paper's [1, x, y, theta, cos, sin]",
    "trig": "[1, cos, sin]: the same wherever the robot is; the choice for a real log",
    "hermite1": "Hermite polynomials of degree 1 times [1, cos, sin]",
    "hermite2": "Hermite polynomials of degree 2 times [1, cos, sin]",
}


def add_options(parser: argparse.ArgumentParser) -> None:  # long: a list of options
    """Add what `run` reads."""
    add_log_options(parser)
    add_force(parser)
    add = parser.add_argument
    add(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FILE",
        help="model file to write (.npz)",
    )
    add(
        "--method",
        choices=("integral", "edmdc"),
        default="integral",
        help="integral (weak form, default) or the paper's edmdc",
    )
    add(
        "--dictionary",
        choices=tuple(DICTIONARIES),
        default="trig",
        metavar="NAME",
        help="functions of the pose in the model (default: trig)\n"
        + "\n".join(f"{name}: {text}" for name, text in DICTIONARIES.items()),
    )
    add(
        "--lags",
        nargs="+",
        metavar="auto|none|AGE",
        help="auto (default): find out how late the robot answers and how it slips, as far as the "
        "log supports it; none; or ages of the commands that act, in periods (0 = no lag)",
    )
    add(
        "--no-symmetry",
        action="store_true",
        help="let the motion depend on where the robot stands and faces: the paper's free fit",
    )
    add(
        "--product",
        action="store_true",
        help="with --lags: each age has weights of its own, and v*omega acts, too",
    )
    add(
        "--dt",
        type=float,
        metavar="S",
        help=f"the model's period [s] (default: {SHORTEST_PERIOD}, or the log's own if longer)",
    )
    add(
        "--gap",
        type=float,
        metavar="S",
        help="a longer time between rows [s] ends an episode (default: 2.5 periods)",
    )
    add(
        "--holdout",
        type=float,
        default=0.5,
        metavar="SHARE",
        help="share of the episodes kept for the check (default: 0.5)",
    )
    add(
        "--horizon",
        type=float,
        default=1.0,
        metavar="S",
        help="how far ahead the check looks [s] (default: 1)",
    )
    add("--seed", type=int, default=0, help="seed of the split (default: 0)")
    add(
        "--vehicle",
        metavar="NAME",
        help="name of the vehicle; kmpc run refuses the model for one of another name",
    )


def run(options: argparse.Namespace) -> int:
    """Fit the logs, print the held-out errors, write the model."""
    from kmpc_lite.learn.fit_summary import describe_fit, format_summary
    from kmpc_lite.learn.loading import load_logs
    from kmpc_lite.learn.noise_sources import check_sources
    from kmpc_lite.learn.provenance import describe_making, format_making, read_vehicle

    keep_inputs(options.output, *options.log)
    vehicle = read_vehicle(options.log, options.vehicle)
    told: list[str] = []
    check_split(options.holdout, options.seed)
    whole = load_logs(options.log, options.dt, options.gap, read_options(options), told.append)
    train, held = split_log(whole, options.log, options.holdout, options.seed)
    free = options.no_symmetry or options.method == "edmdc"
    lags = read_lags(options.lags, options.product, free)
    # with a product, each age has weights of its own
    ages = lags if options.product and lags != "auto" else None
    dictionary = make_dictionary(options.dictionary, ages, options.product)
    symmetric, lags = False if free else None, lags if ages is None else None
    model = kl.fit(train, dictionary, options.method, symmetric=symmetric, lags=lags)
    report = kl.evaluate(model, held, options.horizon)
    facts = describe_fit(model, train, whole, report) if "selection" in model.info else {}
    noise = check_sources(model, held)
    if facts and noise is not None:
        facts["noise"] = noise.as_dict()
    model, calibration = calibrated(model, held)
    made = describe_making(model, options.log, whole, vehicle=vehicle)
    model = with_info(model, {"held_out": report.as_dict(), **made})
    model.save(options.output)
    info = model.info
    if options.json:
        facts_told = {
            "model": str(options.output),
            "logs": told,
            "train": repr(train),
            "held_out": report.as_dict(),
            "margins": calibration.removeprefix("margins: "),
            "made": made,
            **({"learned": facts} if facts else {}),
        }
        keys = ("method", "samples", "rank", "features", "condition")
        print(json.dumps({**facts_told, **{key: info[key] for key in keys}}))
        return 0
    print("\n".join([*(f"log    {line}" for line in told), f"train  {train}", f"held   {held}"]))
    rank = f"rank {info['rank']} of {info['features']}"
    print(f"fit    {info['method']}, {rank}, condition {info['condition']:.3g}")
    if facts:
        print(format_summary(facts))
        if noise is not None:
            print(noise)
    print(f"{report}\n{calibration}\n{format_making(info)}\nwrote  {options.output}")
    return 0


def read_lags(
    given: list[str] | None, product: bool, free: bool
) -> Literal["auto"] | list[int] | None:
    """Read what --lags says: "auto" where nothing is said and nothing speaks against it.

    Raises
    ------
    DataError
        For anything but auto, none or whole numbers, and for auto with a free fit.
    """
    if given is None:
        return None if free or product else "auto"
    if given in (["auto"], ["none"]):
        if given == ["auto"] and (free or product):
            raise kl.DataError(
                "--lags auto goes with the symmetric integral fit and chooses the slip terms "
                "itself: leave out --product, --no-symmetry and --method edmdc"
            )
        return "auto" if given == ["auto"] else None
    try:
        return [int(age) for age in given]
    except ValueError:
        raise kl.DataError(
            f"--lags {' '.join(given)}: expected auto, none, or ages in periods such as 0 1 2"
        ) from None


def load_and_split(
    logs: list[Path],
    dt: float | None,
    gap: float | None,
    holdout: float,
    seed: int,
) -> tuple[kl.Dataset, kl.Dataset]:
    """Read logs at one period; split their episodes into those to learn from and those to check on.

    Parameters
    ----------
    logs : list of Path
        Files and folders of one robot, of any format.
    dt : float, optional
        Period [s]; 0.1, or the first log's own if longer, where not given.
    gap : float, optional
        A longer time between rows ends an episode [s].
    holdout : float
        Share of the episodes that is kept for the check.
    seed : int
        Of the split.

    Raises
    ------
    DataError
        Where the logs are too short to split, something is suspect, or one is given twice.
    """
    from kmpc_lite.learn.loading import load_logs

    check_split(holdout, seed)
    return split_log(load_logs(logs, dt, gap), logs, holdout, seed)


def check_split(holdout: float, seed: int) -> None:
    """Refuse what no log can be split by."""
    if not 0.0 < holdout < 1.0:
        raise kl.DataError(f"--holdout: expected a share between 0 and 1, got {holdout}")
    if seed < 0:
        raise kl.DataError(f"--seed: expected a whole number >= 0, got {seed}")


def split_log(
    data: kl.Dataset, logs: list[Path], holdout: float, seed: int
) -> tuple[kl.Dataset, kl.Dataset]:
    """Split a log, cut into windows where it has few episodes; see `load_and_split`."""
    if len(data) < 10:
        data = data.windows(max(5.0, 50 * data.dt))
    if len(data) < 2:
        where = ", ".join(map(str, logs))
        raise kl.DataError(
            f"{where}: {data.steps * data.dt:g} s of driving are too few to learn from a part "
            "and check the other"
        )
    return data.split(1.0 - holdout, seed=seed)


def make_dictionary(name: str, lags: list[int] | None, product: bool) -> kl.Dictionary:
    """Build a dictionary by its name on the command line."""
    base: kl.Dictionary
    match name:
        case "unicycle":
            base = kl.UnicycleDictionary()
        case "trig":
            base = kl.HermiteTrigDictionary(order=0)
        case _:
            base = kl.HermiteTrigDictionary(order=int(name.removeprefix("hermite")))
    if product and not lags:
        raise kl.ModelError("--product goes with --lags, for example --lags 0 --product")
    return kl.InputHistoryDictionary(base, tuple(lags), product) if lags else base


def calibrated(model: kl.KoopmanModel, held: kl.Dataset) -> tuple[kl.KoopmanModel, str]:
    """Calibrate a model's margins on held-out drives, where those suffice; and tell in a line."""
    from kmpc_lite.control.margins.model_margins import Margins
    from kmpc_lite.learn.windows import largest_speeds

    try:
        model = kl.with_quantiles(model, held)
        how = f"calibrated on {model.info['noise_quantiles']['windows']} held-out windows"
    except kl.DataError as error:
        how = f"not calibrated, cautious ones will be used ({error})"
    speed = largest_speeds(held)[0]
    ahead, aside = Margins(model, kl.NavigationProblem(dt=model.dt)).straight(speed)
    told = f"{100 * aside:.0f} cm from what it passes, {100 * ahead:.0f} cm from what lies ahead"
    return model, f"margins: {how}; {told} at {speed:.2g} m/s"


def with_info(model: kl.KoopmanModel, more: dict[str, Any]) -> kl.KoopmanModel:
    """Return the model with more in its info."""
    return replace(model, info={**model.info, **more})


COMMAND = Command(
    text="Learn a model from a log and check it on parts of the log that it has not seen.",
    examples=(
        "kmpc fit run.csv -o robot.npz",
        "kmpc fit drives/ bag/ -o robot.npz --topics odom=/odom cmd=/cmd_vel",
        "kmpc fit run.csv -o robot.npz --columns t=stamp theta=yaw --units t=ns theta=deg",
        "kmpc fit run.csv -o robot.npz --lags 0 1 2 --product",
    ),
    add_options=add_options,
    run=run,
)
