"""`kmpc fit`: learn a model from logs, check it on what it has not seen, write it."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import kmpc_lite as kl
from kmpc_lite.cli.command import Command, keep_inputs, positive
from kmpc_lite.cli.options import add_force, add_log_options, read_options
from kmpc_lite.defaults import SHORTEST_PERIOD

if TYPE_CHECKING:
    from kmpc_lite.learn.learning import Learned, LearningOptions

DICTIONARIES = {
    "unicycle": "the paper's [1, x, y, theta, cos, sin]",
    "trig": "[1, cos, sin]: the same wherever the robot is; the choice for a real log",
    "hermite1": "Hermite polynomials of degree 1 times [1, cos, sin]",
    "hermite2": "Hermite polynomials of degree 2 times [1, cos, sin]",
}
TO_MEND = ("suspect", "--", "cut ")  # what a line on a log holds if it asks the user for something


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add_log_options(parser)
    add_force(parser)
    add = parser.add_argument
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="model file to write")
    told = "integral (weak form, default) or the paper's edmdc"
    add("--method", choices=("integral", "edmdc"), default="integral", help=told)
    told = "\n".join(f"{name}: {text}" for name, text in DICTIONARIES.items())
    told = f"functions of the pose in the model (default: trig)\n{told}"
    add("--dictionary", choices=tuple(DICTIONARIES), default="trig", metavar="NAME", help=told)
    told = (
        "auto (default): find out how late the robot answers and how it slips, as far as the log "
        "supports it; none; or ages of the commands that act, in periods (0 = no lag)"
    )
    add("--lags", nargs="+", metavar="auto|none|AGE", help=told)
    told = "let the motion depend on position and heading: the paper's free fit"
    add("--no-symmetry", action="store_true", help=told)
    told = f"the model's period [s] (default: {SHORTEST_PERIOD}, or the log's own if longer)"
    add("--dt", type=float, metavar="S", help=told)
    told = "an episode ends if more time lies between rows [s] (default: 2.5 periods)"
    add("--gap", type=float, metavar="S", help=told)
    told = "share of the episodes kept for the check (default: 0.5)"
    add("--holdout", type=float, default=0.5, metavar="SHARE", help=told)
    told = "how far ahead predictions are checked [s] (default: 1)"
    add("--horizon", type=float, default=1.0, metavar="S", help=told)
    add("--seed", type=int, default=0, help="seed of the split (default: 0)")
    told = "print how the model was learned, line by line"
    add("-v", "--verbose", action="store_true", help=told)
    add("--radius", type=positive, metavar="R", help="the robot's radius [m], kept with the model")
    told = "or what it covers: length and width [m], and how far ahead of the pose its middle is"
    add("--footprint", nargs="+", type=float, metavar=("LENGTH WIDTH", "AHEAD"), help=told)
    told = "vehicle's name; kmpc run refuses the model if names differ"
    add("--vehicle", metavar="NAME", help=told)


def run(options: argparse.Namespace) -> int:
    """Fit the logs, print the held-out errors, write the model."""
    from kmpc_lite.learn.learning import learn, read_vehicle
    from kmpc_lite.learn.loading import load_logs

    keep_inputs(options.output, *options.log)
    vehicle = read_vehicle(options.log, options.vehicle)
    told: list[str] = []
    shape = read_shape(options.radius, options.footprint)
    how = learning_options(options)
    whole = load_logs(options.log, options.dt, options.gap, read_options(options), told.append)
    learned = learn(whole, options.log, how, vehicle, shape)
    learned.model.save(options.output)
    if options.json:
        print(json.dumps(as_dict(learned, options.output, told)))
    else:
        print("\n".join(tell_learned(learned, told, options.verbose)))
        more = "" if options.verbose else " (-v tells how it was learned)"
        print(f"wrote  {options.output}{more}")
    return 0


def as_dict(learned: Learned, output: Path, told: list[str]) -> dict[str, Any]:
    """What was learned, as values that JSON can hold."""
    from kmpc_lite.cli.self_drive import warn_of_driving
    from kmpc_lite.learn.verdict import describe_robot, verdict

    info = learned.model.info
    return {
        "model": str(output),
        "verdict": verdict(learned.report, learned.facts, learned.made["driven"]),
        "robot": describe_robot(learned.made, learned.facts),
        "warnings": warn_of_driving(learned.model),
        "logs": told,
        "train": repr(learned.train),
        "held_out": learned.report.as_dict(),
        "margins": tell_margins(learned),
        "made": learned.made,
        **({"learned": learned.facts} if learned.facts else {}),
        **{key: info[key] for key in ("method", "samples", "rank", "features", "condition")},
    }


def tell_learned(learned: Learned, told: list[str], verbose: bool = False) -> list[str]:
    """The robot, the verdict on its model, and two lines more; or all that is known of it."""
    from kmpc_lite.cli.self_drive import warn_of_driving
    from kmpc_lite.learn.verdict import (
        format_making,
        format_summary,
        tell_errors,
        tell_robot,
        verdict,
    )

    info, facts = learned.model.info, learned.facts
    lines = [
        tell_robot(learned.made, facts),
        verdict(learned.report, facts, learned.made["driven"]),
        *(f"warn   {line}" for line in warn_of_driving(learned.model)),
    ]
    margins = f"margins: {tell_margins(learned)}"
    if not verbose:
        to_mend = (f"log    {line}" for line in told if any(word in line for word in TO_MEND))
        return [*lines, tell_errors(learned.report), margins, *to_mend]
    rank = f"rank {info['rank']} of {info['features']}"
    return [
        *lines,
        *(f"log    {line}" for line in told),
        f"train  {learned.train}",
        f"held   {learned.held}",
        f"fit    {info['method']}, {rank}, condition {info['condition']:.3g}",
        *([format_summary(facts)] if facts else []),
        f"{learned.report}\n{margins}",
        format_making(info),
    ]


def learning_options(options: argparse.Namespace) -> LearningOptions:
    """Put together what the command line says of the fit.

    Raises KmpcError for what does not go together.
    """
    from kmpc_lite.learn.learning import LearningOptions

    if not 0.0 < options.holdout < 1.0:
        raise kl.DataError(f"--holdout: expected a share between 0 and 1, got {options.holdout}")
    if options.seed < 0:
        raise kl.DataError(f"--seed: expected a whole number >= 0, got {options.seed}")
    free, name = options.no_symmetry or options.method == "edmdc", options.dictionary
    order = int(name.removeprefix("hermite")) if name.startswith("hermite") else 0
    return LearningOptions(
        kl.UnicycleDictionary() if name == "unicycle" else kl.HermiteTrigDictionary(order=order),
        options.method,
        False if free else None,
        read_lags(options.lags, free),
        options.holdout,
        options.horizon,
        options.seed,
    )


def read_lags(given: list[str] | None, free: bool) -> Literal["auto"] | list[int] | None:
    """Read what --lags says: "auto" if nothing is said and nothing speaks against it.

    Raises DataError for anything but auto, none or whole numbers, and for auto with a free fit.
    """
    if given is None:
        return None if free else "auto"
    if given == ["none"]:
        return None
    if given == ["auto"]:
        if free:
            raise kl.DataError(
                "--lags auto goes with the symmetric integral fit and chooses the slip terms "
                "itself: leave out --no-symmetry and --method edmdc"
            )
        return "auto"
    try:
        return [int(age) for age in given]
    except ValueError:
        raise kl.DataError(
            f"--lags {' '.join(given)}: expected auto, none, or ages in periods such as 0 1 2"
        ) from None


def read_shape(radius: float | None, footprint: list[float] | None) -> dict[str, Any]:
    """What is kept of the robot's size; refuses what is no size."""
    if radius is not None and footprint is not None:
        raise kl.DataError("--radius: follows from --footprint: give one of them")
    if footprint is None:
        return {} if radius is None else {"radius": radius}
    if len(footprint) not in (2, 3):
        told = " ".join(f"{value:g}" for value in footprint)
        raise kl.DataError(f"--footprint {told}: expected LENGTH WIDTH or LENGTH WIDTH AHEAD")
    return {"footprint": [list(corner) for corner in kl.Footprint.rectangle(*footprint).corners]}


def tell_margins(learned: Learned) -> str:
    """Tell how a model's margins were calibrated, and how much room they take."""
    from kmpc_lite.control.margins import Margins
    from kmpc_lite.learn.windows import largest_inputs

    model = learned.model
    if learned.uncalibrated:
        how = f"not calibrated, cautious ones will be used ({learned.uncalibrated})"
    else:
        how = f"calibrated on {model.info['noise_quantiles']['windows']} held-out windows"
    speed = largest_inputs(learned.held.inputs)[0]
    # where the robot's size is unknown, the line says for which size it holds
    size = {"robot_radius": model.info["radius"]} if "radius" in model.info else {}
    problem = kl.NavigationProblem(dt=model.dt, **size)
    ahead, aside = Margins(model, problem).straight(speed)
    robot = f"at {speed:.2g} m/s a robot of {100 * problem.robot_radius:.0f} cm radius"
    kept = f"{100 * aside:.0f} cm beside obstacles and {100 * ahead:.0f} cm before them"
    return f"{how}; {robot} keeps {kept}"


COMMAND = Command(
    text="Learn a model from a log, and test it on held-out parts of the log.",
    examples=(
        "kmpc fit run.csv -o robot.npz",
        "kmpc fit drives/ bag/ -o robot.npz --topics odom=/odom cmd=/cmd_vel",
        "kmpc fit run.csv -o robot.npz --columns t=stamp theta=yaw --units t=ns theta=deg",
        "kmpc fit run.csv -o robot.npz --radius 0.2   # kept with the model: simulate, run, export",
    ),
    add_options=add_options,
    run=run,
)
