"""The acados peer says what it lacks, and where it is installed, solves the same problem."""

import subprocess
from pathlib import Path
from typing import Any

import pytest

from kmpc_lab.peers import acados


def test_it_says_in_words_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(acados.platform, "system", lambda: "Linux")
    monkeypatch.setattr(acados.platform, "machine", lambda: "aarch64")
    assert "x86-64" in acados.why_not(tmp_path)
    monkeypatch.setattr(acados.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(acados.shutil, "which", lambda name: None)
    assert "compiler" in acados.why_not(tmp_path)
    monkeypatch.setattr(acados.shutil, "which", lambda name: f"/usr/bin/{name}")
    monkeypatch.setattr(acados.importlib.util, "find_spec", lambda name: None)
    assert "pip install" in acados.why_not(tmp_path)
    monkeypatch.setattr(acados.importlib.util, "find_spec", lambda name: object())
    assert "kmpc bench --install-acados" in acados.why_not(tmp_path)
    (tmp_path / "acados" / "install").mkdir(parents=True)
    assert acados.why_not(tmp_path) == ""


def test_an_installation_keeps_acados_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fake_pip(command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
        scratch = Path(command[command.index("--target") + 1])
        (scratch / "acados" / "install").mkdir(parents=True)
        (scratch / "casadi").mkdir()
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(acados.subprocess, "run", fake_pip)
    target = tmp_path / "acados"
    (target / "old").mkdir(parents=True)
    assert acados.install(target) == target
    assert [p.name for p in target.iterdir()] == ["acados"]
    assert [p.name for p in tmp_path.iterdir()] == ["acados"]
