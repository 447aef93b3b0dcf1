"""The studies by name, and the controllers that are chosen for them."""

import pytest

import kmpc_lite as kl
from kmpc_lab.studies.conditions import STUDIES, choose
from kmpc_lab.studies.contenders import STUDY_CONTENDERS


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_has_its_controllers(name: str) -> None:
    chosen = choose(STUDIES[name], None)
    assert [c.label for c in chosen][-1] in ("ours, everything on", "ours, no adaptation")
    assert {c.label for c in chosen} == set(STUDIES[name].controllers)
    names = [c.name for c in STUDIES[name].conditions]
    assert len(set(names)) == len(names)


def test_controllers_are_chosen_by_words() -> None:
    assert choose(STUDIES["maps"], ["paper", "no adapt"]) == [
        c for c in STUDY_CONTENDERS if "paper" in c.label or "no adapt" in c.label
    ]
    with pytest.raises(kl.ProblemError, match=r"nobody is left; labels are NMPC, IPOPT; "):
        choose(STUDIES["maps"], ["nobody"])
    with pytest.raises(kl.ProblemError, match="integral"):
        choose(STUDIES["lag"], ["everything on", "K-NMPC"])
