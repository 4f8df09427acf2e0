"""The study of logs in which a joint rests, in small."""

import pytest

from experiments.studies.resting import Judged, judged, table


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_right_plant_is_at_the_floor_unless_an_angle_never_moves(seed: int) -> None:
    found = judged(seed)
    assert not found.left
    assert found.ratio == pytest.approx(1.0, abs=0.2) or found.resting > 0.9


def test_the_table_has_every_log_once() -> None:
    found = [Judged(0.05, 1.0, False), Judged(0.1, 0.9, True), Judged(0.95, 3.0, False), Judged(1.0, 2.0, False)]
    counts = [row.split("|")[2].strip() for row in table(found).splitlines()[2:]]
    assert counts == ["1", "1", "0", "2"]
    assert "2.00 … 3.00" in table(found)
