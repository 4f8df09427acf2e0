"""`furuta compare --gif --sample-time`: films beside the figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from experiments.cli.compare import _film_names, _usual
from tests.commands import furuta


def test_films_lie_beside_the_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import controllers.comparison.conditions
    import controllers.comparison.film

    monkeypatch.setattr(controllers.comparison.conditions, "_harder", lambda *_: [])  # the plain swing-up alone
    filmed = []
    whole = controllers.comparison.film.film

    def short(*arguments: object, **options: object) -> Path:
        filmed.append((arguments[1].name, arguments[2], options["task"]))  # type: ignore[attr-defined]
        return whole(*arguments, **options, seconds=0.2)  # type: ignore[arg-type]

    monkeypatch.setattr(controllers.comparison.film, "film", short)
    common = ("--controllers", "swing-up,lqr", "--groups", "balance,swing_up", "--trials", 2, "--duration", 1)
    result = furuta(
        "compare", "--plant", "large", *common, "--sample-time", 0.004, "--gif", "-o", tmp_path / "c", "--json"
    )
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["settings"]["sample_time"] == 0.004
    assert filmed == [("swing-up", 0.004, "swing_up"), ("lqr", 0.004, "balance")]
    assert {"swing-up.gif", "lqr.gif", "comparison.json"} <= {file.name for file in (tmp_path / "c").iterdir()}


def test_films_of_an_earlier_comparison_do_not_stay(tmp_path: Path) -> None:
    """Another's film does."""
    out = tmp_path / "c"
    common = ("--plant", "large", "--groups", "balance", "--trials", 1, "--duration", 1, "-o", out)
    assert furuta("compare", *common, "--controllers", "lqr").exit_code == 0
    for name in ("lqr.gif", "mine.gif"):
        (out / name).touch()
    assert furuta("compare", *common, "--controllers", "dlqr").exit_code == 0
    assert sorted(path.name for path in out.glob("*.gif")) == ["mine.gif"]


def test_controllers_of_one_name_have_films_of_their_own() -> None:
    assert _film_names(["a/my lqr.zip", "dlqr", "b/my lqr.zip"]) == ["my-lqr.gif", "dlqr.gif", "my-lqr-2.gif"]


def test_swing_ups_are_played_where_a_controller_swings_up() -> None:
    policy = Path(__file__).parents[2] / "controllers" / "policies"
    usual = "balance,push,parameters,delay"
    assert _usual(["lqr", "lqg", str(policy / "balance-qube.zip"), "none.zip"]) == usual
    for name in ("swing-up", "planned", str(policy / "swing-up-qube.zip")):
        assert _usual(["lqr", name]) == f"{usual},swing_up"
