"""What a user says of a file: text that is read as it is suggested, and text that is refused."""

from __future__ import annotations

import shlex

import pytest

from identification.logs.log import LogError
from identification.logs.rig_mapping import RigMapping
from identification.logs.said import parse_columns, parse_flip


@pytest.mark.parametrize(
    ("text", "message"),
    [("t", "pairs such as"), ("t=", "pairs such as"), ("x=y", "'x' on the left"), ("t=a,t=b", "twice")],
)
def test_column_strings(text, message):
    with pytest.raises(LogError, match=message):
        parse_columns(text)


@pytest.mark.parametrize(("flip", "message"), [("q3", "expected q1, q2 or u"), ("q1,q1", "twice")])
def test_flip_strings(flip, message):
    with pytest.raises(LogError, match=message):
        parse_flip(flip)
    assert parse_flip(["q1,u", "q2"]) == ("q1", "u", "q2")


def test_columns_with_commas_can_be_typed_as_they_are_suggested():
    columns = {"t": "Time, s", "q1": "Arm, deg", "q2": "Pendulum, deg", "u": "U, V"}
    (option, text) = shlex.split(RigMapping(**columns).options())
    assert option == "--columns"
    assert parse_columns(text) == columns
    assert parse_columns("t=Time , q1 = Arm,") == {"t": "Time", "q1": "Arm"}
    with pytest.raises(LogError, match="'theta' on the left"):
        parse_columns("t=Time,theta=Arm")
