"""Occupancy grids: from messages and map_server's files to rectangles, and ways through them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from public_cases import case

import kmpc_lite as kl
from kmpc_lite.control.world.solids import Solids

YAML = (
    "image: map.pgm\nresolution: 0.05\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\noccupied_thresh: "
    "0.65\nfree_thresh: 0.196\n"
)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"data": [0, 100]}, "shape"),
        ({"data": [[0, 1], [2]]}, "cells"),
        ({"resolution": 0.0}, "resolution"),
        ({"resolution": "fine"}, "resolution"),
        ({"threshold": 0.0}, "threshold"),
        ({"data": [[0, 1], [1, -1]]}, "got values from 0 to 1 alone"),
        ({"data": [[0.0, 0.2], [0.97, 1.0]]}, "100 times probabilities"),
    ],
)
def test_grids_that_are_none_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(kl.ProblemError, match=words) as refused:
        kl.OccupancyGrid(**{"data": [[0, 100]], "resolution": 0.1, **options})
    assert "\n" not in str(refused.value)


def test_what_is_occupied_is_a_matter_of_threshold_and_unknown() -> None:
    data = [[-1, 0, 49, 64, 65, 100]]
    found = kl.OccupancyGrid(data, 0.1)
    assert found.occupied.tolist() == [[True, False, False, True, True, True]]
    assert found.unknown.tolist() == [[True, False, False, True, False, False]]
    with pytest.warns(UserWarning, match="1 cells from 50 to below 65 of 100 count as free"):
        kl.OccupancyGrid(data, 0.1, unknown_is_free=True)
    assert kl.OccupancyGrid(data, 0.1, threshold=10, unknown_is_free=True).occupied.tolist() == [
        [False, False, True, True, True, True]
    ]
    cells = np.array([[0, 100]], dtype=np.int8)
    grid = kl.OccupancyGrid(cells, 0.1)
    cells[:] = 100
    assert grid.occupied.tolist() == [[False, True]]


@settings(max_examples=50)
@given(seed=st.integers(0, 10_000))
def test_rectangles_are_the_occupied_cells_each_once(seed: int) -> None:
    random = np.random.default_rng(seed)
    occupied = random.random(tuple(random.integers(1, 12, 2))) < random.uniform(0.0, 1.0)
    covered = np.zeros(occupied.shape, dtype=int)
    sides = np.rint(kl.OccupancyGrid(occupied, 1.0).rectangles).astype(int)
    for x_min, y_min, x_max, y_max in sides:
        covered[y_min:y_max, x_min:x_max] += 1
    np.testing.assert_array_equal(covered, occupied)


def test_the_origin_places_and_turns_a_grid() -> None:
    grid = kl.OccupancyGrid([[100, 0]], 1.0, (2.0, 3.0, np.pi / 2))
    whole = Solids([grid]).whole
    # the occupied cell reaches from (2, 3) to (1, 4)
    np.testing.assert_allclose(
        whole.least(np.array([[1.5, 3.5], [2.5, 3.5], [1.5, 4.5]])), [-0.5, 0.5, 0.5], atol=1e-12
    )


def write(folder: Path, yaml: str = YAML, image: bytes | None = None) -> Path:
    """Write map.yaml and map.pgm.

    At the default the upper left pixel is black, the lower right unknown, the rest white.
    """
    pixels = bytes([0, 254, 254, 254, 254, 205])
    (folder / "map.pgm").write_bytes(
        b"P5\n# CREATOR: map_saver\n3 2\n255\n" + pixels if image is None else image
    )
    (folder / "map.yaml").write_text(yaml, encoding="utf-8")
    return folder / "map.yaml"


def test_map_server_files_are_read_with_their_highest_row_first(tmp_path: Path) -> None:
    grid = kl.OccupancyGrid.load(write(tmp_path), unknown_is_free=True)
    assert (grid.resolution, grid.origin) == (0.05, (-1.0, -2.0, 0.0))
    assert grid.occupied.tolist() == [[False, False, False], [True, False, False]]
    assert grid.unknown.tolist() == [[False, False, True], [False, False, False]]
    wary = kl.OccupancyGrid.load(tmp_path / "map.yaml")
    assert wary.occupied.tolist() == [[False, False, True], [True, False, False]]
    # plain images, 16 bits, negated brightness and lists in YAML's block form say the same
    block = YAML.replace("[-1.0, -2.0, 0.0]", "\n  - -1.0\n  - -2.0\n  - 0.0")
    block = block.replace("negate: 0", "negate: 1  # dark is free")
    plain = write(tmp_path, block, b"P2 3 2 100 100 0 0\n0 0 20")
    assert kl.OccupancyGrid.load(plain, unknown_is_free=True) == grid
    deep = np.array([0, 65278, 65278, 65278, 65278, 52685], dtype=">u2").tobytes()
    deep_map = write(tmp_path, YAML, b"P5 3 2 65535\n" + deep)
    assert kl.OccupancyGrid.load(deep_map, unknown_is_free=True) == grid
    # map_saver writes the whole path that it was given
    moved = write(tmp_path, YAML.replace("map.pgm", "/home/me/map.pgm"))
    with pytest.warns(UserWarning, match="map.pgm beside it is read, not /home/me/map.pgm"):
        assert kl.OccupancyGrid.load(moved, unknown_is_free=True) == grid


@pytest.mark.parametrize(
    ("yaml", "image", "words"),
    [
        (YAML.replace("0.05", "fine"), None, "resolution: expected a number"),
        (YAML.replace("[-1.0, -2.0, 0.0]", "[1.0]"), None, "origin: expected"),
        (YAML + "mode: scale\n", None, "only trinary"),
        (YAML.replace("map.pgm", "../map.pgm"), None, "in the map's own folder"),
        (YAML.replace("0.65", "-0.65"), None, "a share from 0 to 1, got -0.65"),
        (YAML, b"P2 3 2 255\n1 2 x", "whole numbers"),
        (YAML, b"P5 3 2 0\n123456", "values up to 0"),
    ],
)
def test_damaged_map_files_are_named_in_one_line(
    tmp_path: Path, yaml: str, image: bytes | None, words: str
) -> None:
    with pytest.raises(kl.ProblemError, match=words) as refused:
        kl.OccupancyGrid.load(write(tmp_path, yaml, image))
    assert "\n" not in str(refused.value)


def test_a_patch_makes_a_new_grid_and_nothing_new_is_the_same_grid() -> None:
    random = np.random.default_rng(0)
    cells = random.choice([-1, 0, 100], (30, 40))
    grid = kl.OccupancyGrid(cells, 0.1, (1.0, 2.0, 0.3))
    patch = random.choice([-1, 0, 100], (5, 7))
    found = grid.update(patch, row=4, column=9)
    whole = cells.copy()
    whole[4:9, 9:16] = patch
    expected = kl.OccupancyGrid(whole, 0.1, (1.0, 2.0, 0.3))
    assert found == expected and found is not grid
    np.testing.assert_array_equal(found.rectangles, expected.rectangles)
    np.testing.assert_array_equal(grid.occupied, cells != 0)
    assert found.update(patch, row=4, column=9) is found
    assert not found.occupied.flags.writeable


@pytest.mark.parametrize(
    ("patch", "place", "words"),
    [
        (np.zeros((5, 5)), (26, 0), "beyond"),
        (np.zeros((5, 5)), (-1, 0), "row and a column"),
        ([[101]], (0, 0), "-1 to 100"),
    ],
)
def test_patches_that_are_none_are_refused(patch: Any, place: tuple[int, int], words: str) -> None:
    grid = kl.OccupancyGrid(np.zeros((30, 40)), 0.1)
    with pytest.raises(kl.ProblemError, match=words):
        grid.update(patch, *place)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("percent", "occupied_thresh: expected a share from 0 to 1, got 65; 65 % would be 0.65"),
        ("not_a_number", "occupied_thresh: expected a share from 0 to 1, got nan"),
        ("swapped", "expected free_thresh < occupied_thresh, got 0.9 and 0.1"),
    ],
)
def test_thresholds_that_would_lose_the_walls_are_refused(name: str, words: str) -> None:
    with pytest.raises(kl.ProblemError, match=words):
        kl.OccupancyGrid.load(case(f"maps/{name}.yaml"))


def test_map_savers_grey_stays_unknown_and_the_user_is_warned() -> None:
    with pytest.warns(UserWarning, match="makes the grey 205 free"):
        grid = kl.OccupancyGrid.load(case("maps/nav2_humble.yaml"))
    assert grid.unknown.any() and (grid.occupied >= grid.unknown).all()
