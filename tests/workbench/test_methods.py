"""What a run is reduced by, in words."""

import pytest

from ddenv.schemas import names, uses
from ddenv.words.methods import KINDS, labels, note, paragraph

EVERY = [(kind, name) for kind in KINDS for name in names(kind)]


@pytest.mark.parametrize(("kind", "name"), EVERY, ids=[name for _, name in EVERY])
def test_every_name_is_explained_in_a_paragraph(kind, name):
    words = paragraph(kind, name)
    assert len(words) > 60
    assert words.endswith(".")
    assert "\n" not in words


def test_what_is_not_installed_is_said_to_be_so():
    assert paragraph("algorithm", "theirs") == "It comes with a package that is not installed here."


@pytest.mark.parametrize("algorithm", [*names("algorithm"), "theirs"])
def test_each_part_of_the_pair_is_used_or_said_not_to_be(algorithm):
    for kind in ("partitioning", "prioritization"):
        assert (kind in uses(algorithm)) != note(kind, algorithm).startswith(
            f"Not used by {algorithm}"
        )


def test_the_labels_get_shorter():
    for algorithm in (*names("algorithm"), "theirs"):
        told = labels(algorithm, "model2model/failure-proximal")
        assert list(told) == sorted(told, key=len, reverse=True)
        assert ("failure-proximal" in told[0]) == ("prioritization" in uses(algorithm))
