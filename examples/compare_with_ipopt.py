"""Compare our SQP with CasADi and IPOPT on one problem: cost of each plan, time of each step.

Both drive the exact robot past four obstacles and start from their own last plan, as on a robot.
The cost is that of the first plan, solved to convergence by both; the times are medians over the
drive. Ours is switched to the paper's formulation, without guidance and learned margins, since
IPOPT knows neither.

    python examples/compare_with_ipopt.py       # needs: pip install 'kmpc-lab[peers]'
"""

from statistics import median
from typing import Any

import numpy as np

import kmpc_lite as kl
from kmpc_lab import IpoptController, Scenario

PAPER: dict[str, Any] = {"guidance": False, "tightening": None}


def first_cost(controller: Any, problem: kl.NavigationProblem, scenario: Scenario) -> float:
    plan = controller.step(scenario.start, scenario.goal, scenario.circles)
    controller.reset()
    return problem.cost(plan.states, plan.inputs, np.array(scenario.goal))


def step_times(
    controller: Any, scenario: Scenario, model: kl.KoopmanModel, periods: int = 50
) -> list[float]:
    x, times = np.array(scenario.start), []
    for _ in range(periods):
        plan = controller.step(x, scenario.goal, scenario.circles)
        times.append(1e3 * plan.timing["total"])
        x = model.predict(x, plan.command)
    return times


def main() -> None:
    scenario, model = Scenario.load("four_circles_1"), kl.nominal_unicycle(0.1)
    problem = scenario.problem()
    converged = kl.Controller(model, problem, **PAPER, sqp_iterations=100)
    try:
        ipopt = IpoptController(converged.model, problem)
    except kl.KmpcError as error:
        print(f"nothing to compare with: {error}")
        return
    print("cost of the first plan")
    print(f"  ours, to convergence  {first_cost(converged, problem, scenario):10.4f}")
    print(f"  CasADi + IPOPT        {first_cost(ipopt, problem, scenario):10.4f}")
    print("median time of a step [ms]")
    real_time = kl.Controller(model, problem, **PAPER)
    print(f"  ours, real time       {median(step_times(real_time, scenario, model)):10.2f}")
    print(f"  CasADi + IPOPT        {median(step_times(ipopt, scenario, model)):10.2f}")


if __name__ == "__main__":
    main()
