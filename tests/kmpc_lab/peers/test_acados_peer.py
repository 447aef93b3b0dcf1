"""The acados peer says what it lacks, and where it is installed, solves the same problem."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.peers import acados, acados_wheel

WHY_NOT = acados_wheel.why_not()


def test_it_says_in_words_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(acados_wheel.platform, "system", lambda: "Linux")
    monkeypatch.setattr(acados_wheel.platform, "machine", lambda: "aarch64")
    assert "x86-64" in acados_wheel.why_not(tmp_path)
    monkeypatch.setattr(acados_wheel.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(acados_wheel.shutil, "which", lambda name: None)
    assert "compiler" in acados_wheel.why_not(tmp_path)
    monkeypatch.setattr(acados_wheel.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(acados_wheel.importlib.util, "find_spec", lambda name: None)
    assert "pip install" in acados_wheel.why_not(tmp_path)
    monkeypatch.setattr(acados_wheel.importlib.util, "find_spec", lambda name: object())
    assert "kmpc bench --install-acados" in acados_wheel.why_not(tmp_path)
    (tmp_path / "acados" / "install").mkdir(parents=True)
    assert acados_wheel.why_not(tmp_path) == ""


def test_limits_on_the_change_of_commands_are_refused() -> None:
    with pytest.raises(kl.ProblemError, match="du_max") as caught:
        acados.AcadosController(kl.nominal_unicycle(0.1), kl.NavigationProblem(du_max=(1.0, 4.0)))
    assert "\n" not in str(caught.value)


def test_only_the_wheel_that_was_tested_is_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def pip(command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        asked.extend([*command, Path(command[command.index("-r") + 1]).read_text()])
        return subprocess.CompletedProcess(command, 1, "", "ERROR: THESE PACKAGES DO NOT MATCH")

    monkeypatch.setattr(acados_wheel.subprocess, "run", pip)
    with pytest.raises(kl.KmpcError, match="DO NOT MATCH"):
        acados_wheel.install(tmp_path / "cache" / "acados")
    assert {"--require-hashes", "--only-binary=:all:", "--no-deps"} <= set(asked)
    assert asked[-1].startswith("comma-deps-acados==") and " --hash=sha256:" in asked[-1]


def test_a_failed_installation_is_told_in_pips_last_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_network(*command: Any, **options: Any) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(
            command, 1, "", "WARNING: retrying\nERROR: no matching distribution\n"
        )

    monkeypatch.setattr(acados_wheel.subprocess, "run", no_network)
    with pytest.raises(kl.KmpcError, match="no matching distribution") as caught:
        acados_wheel.install(tmp_path / "cache" / "acados")
    assert "\n" not in str(caught.value)
    assert not list((tmp_path / "cache").iterdir())  # nothing half-installed


def test_an_installation_keeps_acados_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fake_pip(command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        scratch = Path(command[command.index("--target") + 1])
        (scratch / "acados" / "install").mkdir(parents=True)
        (scratch / "casadi").mkdir()
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(acados_wheel.subprocess, "run", fake_pip)
    target = tmp_path / "acados"
    (target / "old").mkdir(parents=True)
    assert acados_wheel.install(target) == target
    assert [p.name for p in target.iterdir()] == ["acados"]
    assert [p.name for p in tmp_path.iterdir()] == ["acados"]


@pytest.mark.long
@pytest.mark.skipif(
    bool(acados_wheel.why_not()), reason=f"acados: {acados_wheel.why_not() or 'there'}"
)
def test_it_drives_the_same_way_past_an_obstacle() -> None:
    problem, model = kl.NavigationProblem(), kl.nominal_unicycle(0.1)
    peer = acados.AcadosController(model, problem)
    x, circles = np.array([0.0, 0.0, 0.3]), [kl.Circle(0.6, 0.7, 0.15)]
    for _ in range(60):
        plan = peer.step(x, (1.5, 1.5, 0.0), circles)
        assert (np.abs(plan.command) <= problem.bounds[1] + 1e-9).all()
        x = model.predict(x, plan.command)
        assert np.hypot(x[0] - 0.6, x[1] - 0.7) > 0.3 - 0.02
    assert np.hypot(x[0] - 1.5, x[1] - 1.5) < 0.1
