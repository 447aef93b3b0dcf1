import gc
import os

import pytest

from kmpc_lite.realtime import prepare_process


def test_preparing_a_process_reports_what_was_not_permitted(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise PermissionError("not you")

    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    try:
        told = "\n".join(prepare_process(cpu=0))
    finally:
        gc.unfreeze()
    assert "not pinned" in told and "not permitted (not you)" in told and "not limited" in told
