"""Learn a robot from its log in two ways, and compare how each predicts drives it has not seen.

Records a few minutes of random driving on a floor that slips (use
`kmpc_lite.Dataset.load("run.csv")` for a log of your own), fits the paper's one-step model
(``edmdc``) and the generator in weak form (``integral``), and prints the held-out errors.

    python examples/learn_from_log.py
"""

from pathlib import Path

import kmpc_lab
import kmpc_lite as kl

SECONDS_AHEAD = 2.0
OUTPUT = Path("out")


def main() -> None:
    floor = kmpc_lab.DifferentialDrive(slip=0.05, seed=1)
    log = kmpc_lab.generate_dataset(floor, episodes=40, steps=100, dt=0.1, seed=1, u_max=(0.6, 0.8))
    OUTPUT.mkdir(exist_ok=True)
    log.save(OUTPUT / "drive.csv")
    data = kl.Dataset.load(OUTPUT / "drive.csv")
    train, held = data.split(0.5, seed=0)
    print(f"learned from {train}\nchecked on   {held}\n")

    print(
        f"root mean square error, {SECONDS_AHEAD:g} s ahead      longitudinal [mm]  lateral [mm]  "
        "heading [mrad]"
    )
    for method in ("edmdc", "integral"):
        model = kl.fit(train, kl.UnicycleDictionary(), method=method)
        report = kl.evaluate(model, held, horizon=SECONDS_AHEAD)
        along, across, turn = (1e3 * error for error in report.multi_step)
        print(f"  {method:<38}{along:>18.1f}{across:>14.1f}{turn:>16.1f}")
    along, across, turn = (1e3 * error for error in report.nominal_multi_step)
    print(f"  {'a robot that obeys exactly':<38}{along:>18.1f}{across:>14.1f}{turn:>16.1f}")

    model.save(OUTPUT / "robot.npz")
    print(
        f"\nwrote drive.csv and robot.npz below {OUTPUT}: "
        f"kmpc simulate --model {OUTPUT / 'robot.npz'} drives it"
    )


if __name__ == "__main__":
    main()
