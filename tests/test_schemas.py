"""The registry: every schema and algorithm by name, ours and other packages'."""

import pytest

from ddenv import schemas
from ddenv.errors import UserError
from ddenv.runs.tests_left import SCALE
from ddenv.words.methods import LISTINGS, SMALLER
from tests.command import loaded, python

KINDS = ("partitioning", "prioritization", "algorithm")
EVERY = [(kind, name) for kind in KINDS for name in schemas.names(kind)]


# The paper's Table I, and the algorithms that the paper's is compared with.
PROMISED = {
    "partitioning": {"model2model", "timeseg", "trajectoryseg", "learner"},
    "prioritization": {
        "random",
        "sequential",
        "failure-proximal",
        "avg-trajectory-proximal",
        "min-trajectory-proximal",
        "timestep",
    },
    "algorithm": {"ddenv", "ddmin", "probdd", "splitting"},
}


def test_all_of_table_one_is_there():
    assert {kind: names - set(schemas.names(kind)) for kind, names in PROMISED.items()} == {
        kind: set() for kind in KINDS
    }
    pairs = [
        (part, order) for part in PROMISED["partitioning"] for order in PROMISED["prioritization"]
    ]
    assert {f"{part}/{order}" for part, order in pairs} <= set(schemas.pairs())


@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_each_can_be_loaded_and_explains_itself_in_a_paragraph(kind, name):
    assert callable(schemas.load(kind, name))
    words = schemas.explanation(kind, name)
    assert 80 < len(words) < 700
    assert words.endswith(".")
    assert "\n" not in words


def test_explaining_imports_nothing_numerical():
    every = (
        "schemas.explanation(kind, name) for kind in schemas.OURS for name in schemas.names(kind)"
    )
    code = f"from ddenv import schemas\nassert all({every})"
    assert loaded(code, "numpy", "sklearn", "scipy") == []


def test_an_unknown_name_is_told_with_the_nearest():
    with pytest.raises(
        UserError, match=r"no partitioning 'model2mode' \(did you mean model2model\?\); use one of"
    ):
        schemas.load("partitioning", "model2mode")
    with pytest.raises(UserError, match=r"no prioritization 'nearest'"):
        schemas.split_pair("timeseg/nearest")
    with pytest.raises(UserError, match="write partitioning/prioritization"):
        schemas.split_pair("timeseg")


PLUGIN = '''
def by_name(partitions, evidence):
    """Partitions are tried by the last letter of their first model's name. It only shows how it is done.

    Not for the screen.
    """
    return [float(ord(partition[0][-1])) for partition in partitions]


def one_by_one(elements, guide):
    """Leaves out one model after another."""
    from ddenv.reduction.algorithms import sweep

    return sweep(elements)


def too_few(partitions, evidence):
    return [1.0]


def half(environment, n, evidence):
    return [environment[::2]]


class Needy:
    def __init__(self, something):
        pass


number = 7
'''
DEEP = b"""\xef\xbb\xbf'A module that begins with a mark, and has a strange escape: \\d'
class Near:
    @staticmethod
    def to(partitions, evidence):
        return [0.0 for _ in partitions]


def order(partitions, evidence):
    'As they come.'
    return [0.0 for _ in partitions]
"""
ENTRY_POINTS = """
[ddenv.prioritizations]
by-name = some_robotics_lab:by_name
broken = some_robotics_lab:nothing
no-function = some_robotics_lab:number
gone = not_installed:any
inside = large_lab.orders.near:Near.to [fast]
rude = large_lab.rude:order
deep = large_lab.orders.near:order
a/b = some_robotics_lab:by_name
too-few = some_robotics_lab:too_few

[ddenv.partitionings]
half = some_robotics_lab:half
needy = some_robotics_lab:Needy

[ddenv.algorithms]
one-by-one = some_robotics_lab:one_by_one
ddenv = some_robotics_lab:one_by_one
"""


@pytest.fixture
def plugin(tmp_path):
    """Another package with schemas of its own, as pip would have put it there; runs code beside
    it.
    """
    (tmp_path / "some_robotics_lab.py").write_text(PLUGIN)
    lab = tmp_path / "large_lab"
    (lab / "orders").mkdir(parents=True)
    (lab / "__init__.py").write_text("print('imported')\n")
    (lab / "orders" / "__init__.py").write_text("")
    (lab / "orders" / "near.py").write_bytes(DEEP)
    (lab / "rude.py").write_text("import sys\nsys.exit('no licence')\n")
    info = tmp_path / "some_robotics_lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-robotics-lab\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)

    return lambda code: python(f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{code}")


@pytest.mark.programs
def test_another_packages_schema_is_listed_explained_and_used(plugin):
    done = plugin(
        "import ddenv; from ddenv import schemas\n"
        "print('some_robotics_lab' in sys.modules, 'timeseg/by-name' in schemas.pairs())\n"
        "print(schemas.explanation('prioritization', 'by-name'), 'some_robotics_lab' in "
        "sys.modules)\n"
        "facts = dict(positions={n: (i, 0, 0) for i, n in enumerate('abcdef')}, failure_pose=(0, "
        "0, 0))\n"
        "print(ddenv.reduce('abcdef', lambda kept: kept >= {'c'}, prioritization='by-name', "
        "**facts).kept)\n"
        "print(ddenv.reduce('abcdef', lambda kept: kept >= {'c'}, algorithm='one-by-one', "
        "iterations=0, **facts).tests)\n"
    )
    assert done.stderr == ""
    assert done.stdout.splitlines() == [
        "False True",
        (
            "Partitions are tried by the last letter of their first model's name. It only shows "
            "how it is done. False"
        ),
        "('c',)",
        # All at first, the five that go, c in vain, and c again when it is alone.
        "8",
    ]


def test_explaining_imports_no_package_and_tells_nothing_else(plugin):
    done = plugin(
        "from ddenv import schemas\n"
        "print([schemas.explanation('prioritization', name) for name in ('deep', 'rude', "
        "'inside')])\n"
        "print('a/b' in schemas.names('prioritization'))"
    )
    assert (done.stdout.splitlines(), done.stderr) == (["['As they come.', '', '']", "False"], "")


def test_entry_points_may_point_into_classes(plugin):
    done = plugin(
        "from ddenv import schemas; print(schemas.load('prioritization', 'inside')([1], None))"
    )
    assert done.stdout.splitlines() == ["imported", "[0.0]"]


BREAK_THEIR_WORD = {
    "half/sequential": "partitioning 'half': its partitions must be disjoint, not empty, and cover E",
    "needy/sequential": "partitioning 'needy': cannot be instantiated:",
    "half/rude": "prioritization 'rude': large_lab.rude:order cannot be loaded: no licence",
    "model2model/too-few": "prioritization 'too-few': expected a score for each of 2 partitions",
}


@pytest.mark.programs
def test_a_schema_that_breaks_its_word_is_told_in_one_line(plugin):
    done = plugin(
        "import ddenv\n"
        "facts = dict(positions={n: (i, 0, 0) for i, n in enumerate('abcdef')}, failure_pose=(0, "
        "0, 0))\n"
        f"for split, order in map(lambda pair: pair.split('/'), {list(BREAK_THEIR_WORD)}):\n"
        "    try:\n"
        "        ddenv.reduce('abcdef', lambda kept: kept >= {'c'}, partitioning=split, "
        "prioritization=order, **facts)\n"
        "    except ddenv.UserError as error:\n"
        "        print('told:', error)\n"
    )
    lines = [line for line in done.stdout.splitlines() if line != "imported"]
    for line, words in zip(lines, BREAK_THEIR_WORD.values(), strict=True):
        assert line.startswith("told: ") and words in line, done.stderr


BROKEN = {
    "broken": "cannot be loaded",
    "no-function": "is not a function",
    "gone": "cannot be loaded: No module",
}


def test_a_broken_package_is_told_in_one_line(plugin):
    done = plugin(
        "from ddenv import UserError, schemas\n"
        f"for name in {list(BROKEN)}:\n"
        "    try:\n"
        "        print(repr(schemas.explanation('prioritization', name)), end=' ')\n"
        "        schemas.load('prioritization', name)\n"
        "    except UserError as error:\n"
        "        print(error)\n"
    )
    for line, (name, words) in zip(done.stdout.splitlines(), BROKEN.items(), strict=True):
        assert line.startswith("'' ") and f"prioritization '{name}'" in line and words in line, (
            done.stderr
        )


def test_ours_come_first_and_cannot_be_replaced_by_name(plugin):
    done = plugin(
        "from ddenv import schemas\n"
        "print(schemas.names('prioritization')[0], schemas.pairs()[0], schemas.load('algorithm', "
        "'ddenv').__module__)"
    )
    assert done.stdout.split() == [
        "failure-proximal",
        "model2model/failure-proximal",
        "ddenv.reduction.algorithms",
    ]


def test_each_algorithm_of_ours_has_its_listing_its_words_and_how_many_tests_it_takes():
    ours = set(schemas.OURS["algorithm"])
    assert set(LISTINGS) == set(SMALLER) == ours
    assert ours <= set(SCALE)
