import numpy as np

from ddenv.map.cells import ROOM, Signs, place_signs


def signs_of(texts, sure=()):
    groups = np.unique(texts, return_inverse=True)[1]
    certain = np.isin(np.arange(len(texts)), list(sure))
    return Signs(texts, groups, np.zeros(len(texts)), certain)


def centers_of(grid):
    found = [np.argwhere(grid == index).mean(axis=0) + 0.5 for index in range(grid.max() + 1)]
    return np.array([(column, row) for row, column in found])


def test_models_that_share_a_cell_each_get_a_letter():
    grid = np.full((8, 40), -1)
    grid[2, 5], grid[3, 5] = 0, 1
    placed = place_signs(grid, np.array([[5.5, 2.5], [5.5, 3.5]]), signs_of(["A", "B"]))
    assert set(placed) == {0, 1}
    assert placed[0] != placed[1]
    assert placed[0] == (1, 5)


def test_no_letter_covers_another_one_or_a_mark():
    grid = np.repeat(np.arange(12).reshape(2, 6), 2, axis=0).repeat(2, axis=1)
    texts = ["AA"] * 6 + ["AB"] * 6
    placed = place_signs(grid, centers_of(grid), signs_of(texts), {(0, 0)})
    cells = [(row, column + offset) for row, column in placed.values() for offset in range(2)]
    assert len(cells) == len(set(cells))
    assert (0, 0) not in cells
    assert all(0 <= column < 12 for _, column in cells)


def test_of_thousands_of_letters_some_are_left_and_one_of_each_part():
    grid = np.repeat(np.arange(3000).reshape(30, 100), 2, axis=0)
    texts = ["A" if index != 1717 else "B" for index in range(3000)]
    placed = place_signs(grid, centers_of(grid), signs_of(texts, sure=[5, 6]))
    assert 50 < len(placed) <= 3000 / ROOM + 3
    assert {1717, 5, 6} <= set(placed)


def test_a_model_that_is_not_seen_has_no_letter():
    assert place_signs(np.full((4, 4), -1), np.zeros((1, 2)), signs_of(["A"])) == {}
    assert place_signs(np.full((4, 4), -1), np.zeros((0, 2)), signs_of([])) == {}
