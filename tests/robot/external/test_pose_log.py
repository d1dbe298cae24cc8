"""The pose log: what is read of it, and what is no log."""

import numpy as np
import pytest

from ddenv.robot.external import simulator
from ddenv.robot.external.simulator import BadLog, PoseLog

ROW = "1,2,3,4,0,0,0,1\n"


def read(text, piece=7):
    log = PoseLog()
    content = text if isinstance(text, bytes) else text.encode()
    for start in range(0, len(content), piece):
        log.add(content[start : start + piece])
    return log.finish()


def test_the_quaternion_is_turned_into_our_order_and_given_its_length():
    assert read("0.5,1,2,3,0.2,0.4,0.4,0.8\n").tolist() == [[0.5, 1, 2, 3, 0.8, 0.2, 0.4, 0.4]]


@pytest.mark.parametrize(
    "text",
    [
        f"t,x,y,z,qx,qy,qz,qw\n{ROW}",
        f"\n  \n# a comment, with commas\ntime, px, py, pz, ox, oy, oz, ow\n{ROW}\n#end",
        ROW.strip(),
        ROW.replace("\n", "\r\n"),
        f"\ufeff{ROW}",
        " 1 , 2 ,3.0,+4e0,0,0, -0 ,1\n",
    ],
)
def test_headers_comments_blanks_and_line_ends_do_not_count(text):
    assert read(text).tolist() == [[1, 2, 3, 4, 1, 0, 0, 0]]


def test_a_row_every_tenth_of_a_second_and_the_last_one_are_kept():
    rows = read("".join(f"{step * 0.001:.3f},{step},0,0,0,0,0,1\n" for step in range(1051)), piece=1000)
    assert rows[:, 0].tolist() == pytest.approx([*np.arange(0, 1.01, 0.1), 1.05])
    assert rows[-1, 1] == 1050


def test_of_rows_at_one_time_the_last_counts():
    assert read("0,0,0,0,0,0,0,1\n0.1,1,0,0,0,0,0,1\n0.1,2,0,0,0,0,0,1\n")[:, 1].tolist() == [0, 2]


def test_progress_gets_what_is_kept():
    reported = []
    log = PoseLog(lambda *row: reported.append(row))
    log.add(ROW.encode() + b"1.01,9,9,9,0,0,0,1\n1.1,2,3,5,0,0,0,1\n1.2,2,")
    assert reported == [(1, (2, 3, 4, 1, 0, 0, 0), {}), (1.1, (2, 3, 5, 1, 0, 0, 0), {})]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no rows; expected t,x,y,z,qx,qy,qz,qw"),
        ("t,x,y,z,qx,qy,qz,qw\n", "no rows"),
        (f"{ROW}{ROW}1,2,3\n", "line 3: expected t,x,y,z,qx,qy,qz,qw (s, m, a quaternion), found '1,2,3'"),
        (f"{ROW}Gazebo says hello\n", "line 2: expected .* found 'Gazebo says hello'"),
        ("1 2 3 4 0 0 0 1\n", "line 1"),
        (f"1,{ROW}", "line 1"),
        ("1,nan,3,4,0,0,0,1\n", "line 1"),
        ("1,2,3,inf,0,0,0,1", "line 1"),
        ("1,2,3,4,0,0,0,0\n", "line 1: the quaternion 0,0,0,0 has no length"),
        (f"{ROW}0.9,2,3,4,0,0,0,1\n", "line 2: time goes back from 1 to 0.9 s"),
        ("-1,2,3,4,0,0,0,1\n", "line 1: time goes back"),
        ("1e18,2,3,4,0,0,0,1\n", "line 1: a number is above 1e[+]09: times are in s, places in m"),
        (f"t,x,y,z,qw,qx,qy,qz\n{ROW}", "line 1: expected t,x,y,z,qx,qy,qz,qw"),
        (f"t,x,y\n{ROW}", "line 1"),
        (f"{ROW}t,x,y,z,qx,qy,qz,qw\n", "line 2"),
        (b"\xff\x00\x1b[31m\n", "line 1"),
        ("x" * 100_000, "line 1: .* found 'x+[.][.][.]'$"),
    ],
)
def test_nonsense_is_reported_with_its_line(text, complaint):
    with pytest.raises(BadLog, match=complaint.replace("(s,", "[(]s,").replace("on)", "on[)]")) as reported:
        read(text)
    assert str(reported.value).isprintable() and len(str(reported.value)) < 200


def test_a_log_that_never_ends_is_too_large_and_takes_no_memory(monkeypatch):
    monkeypatch.setattr(simulator, "MOST_BYTES", 1000)
    log = PoseLog()
    for _ in range(100):
        log.add(ROW.encode())
    assert log.size > 1000
    with pytest.raises(BadLog, match="larger than"):
        log.finish()
    assert len(log.rows()) == 1
