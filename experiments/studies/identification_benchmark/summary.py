"""Tables, JSON and the plot of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from experiments.studies.identification_benchmark.study import Trial
from furuta_gym.files import whole_file
from furuta_gym.plant import THETA_NAMES
from furuta_gym.plant.covariance import NORMAL_95

SCHEMA = "furuta-identification-benchmark/1"
BAR = 1.25  # of the bound; and the coverage wanted of 95 % intervals:
COVERAGE = (0.90, 0.99)
BIAS = 0.25  # of the bound


def cells(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """One record a case and method: bias, rmse, bound (9,) of each θ, their ratio, coverage, seconds, failures."""
    found = []
    for case in dict.fromkeys(t.case for t in trials):
        own = [t for t in trials if t.case == case]
        bound = np.sqrt(np.mean([t.bound**2 for t in own], axis=0))
        for method in own[0].error:
            error = np.array([t.error[method] for t in own])
            std = np.array([t.std[method] for t in own])
            ok = np.isfinite(error).all(axis=1)
            told = np.isfinite(std).all(axis=1) & ok
            inside = np.abs(error[told]) < NORMAL_95 * std[told]
            rmse = np.sqrt(np.mean(error[ok] ** 2, axis=0)) if ok.any() else np.full(9, np.nan)
            found.append(
                {
                    "case": case.name,
                    "rig": case.rig,
                    "T": case.T,
                    "counts": case.counts,
                    "experiment": case.experiment,
                    "method": method,
                    "seeds": int(ok.sum()),
                    "failed": int((~ok).sum()),
                    "bias": np.mean(error[ok], axis=0) if ok.any() else np.full(9, np.nan),
                    "rmse": rmse,
                    "bound": bound,
                    "ratio": rmse / bound,
                    "relative_error": rmse / np.abs(case.plant.theta),
                    "coverage": inside.mean(axis=0) if told.any() else np.full(9, np.nan),
                    "seconds": float(np.median([t.seconds[method] for t in own])),
                }
            )
    return found


def to_json(records: Sequence[dict[str, Any]], settings: dict[str, Any]) -> dict[str, Any]:
    """The records with NaN as null and θ by name."""

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return {n: float(v) if np.isfinite(v) else None for n, v in zip(THETA_NAMES, value, strict=True)}
        return value

    return {
        "schema": SCHEMA,
        "settings": settings,
        "cells": [{key: plain(value) for key, value in record.items()} for record in records],
    }


def limit_table(records: Sequence[dict[str, Any]]) -> str:
    """Markdown: the prediction-error method against the bound, a row a cell."""
    rows = [
        "| cell | seeds | RMSE / bound, rms over θ | worst | largest bias / bound | coverage of 95 % intervals | least "
        "| time of a fit [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r in records:
        if r["method"] != "prediction-error":
            continue
        ratio, coverage = r["ratio"], r["coverage"]
        worst, least = int(np.nanargmax(ratio)), int(np.nanargmin(coverage))
        bias = r["bias"] / r["bound"]
        off = int(np.nanargmax(np.abs(bias)))
        rows.append(
            f"| {r['case']} | {r['seeds']} | {np.sqrt(np.mean(ratio**2)):.2f} | {ratio[worst]:.2f} (θ{worst + 1}) | "
            f"{bias[off]:+.2f} (θ{off + 1}) | {np.mean(coverage):.3f} | {coverage[least]:.2f} (θ{least + 1}) | "
            f"{r['seconds']:.2f} |"
        )
    return "\n".join(rows)


def method_table(records: Sequence[dict[str, Any]]) -> str:
    """Markdown: methods side by side over the cells of each rig and experiment."""
    rows = [
        "| rig, experiment | method | logs | failed | " + " | ".join(f"θ{i}" for i in range(1, 10))
        + " | RMSE / bound (median) | coverage | time [s] |",
        "|---" * 16 + "|",
    ]  # fmt: skip
    for key in dict.fromkeys((r["rig"], r["experiment"], r["method"]) for r in records):
        own = [r for r in records if (r["rig"], r["experiment"], r["method"]) == key]
        error = 100 * np.sqrt(np.nanmean([r["relative_error"] ** 2 for r in own], axis=0))
        coverage = np.array([r["coverage"] for r in own])
        covered = f"{np.nanmean(coverage):.2f}" if np.isfinite(coverage).any() else "—"
        rows.append(
            f"| {key[0]}, {key[1]} | {key[2]} | {sum(r['seeds'] for r in own)} | {sum(r['failed'] for r in own)} | "
            + " | ".join(f"{x:.2g}" for x in error)
            + f" | {np.nanmedian([r['ratio'] for r in own]):.3g} | {covered} | "
            f"{np.median([r['seconds'] for r in own]):.2f} |"
        )
    return "\n".join(rows)


def pooled_table(records: Sequence[dict[str, Any]]) -> str:
    """Markdown: RMSE / bound of the prediction-error method, all sample times and encoders of a rig together."""
    header = " | ".join(f"θ{i}" for i in range(1, 10))
    rows = [f"| rig, experiment | logs | {header} | all | coverage |", "|---" * 13 + "|"]
    for key in dict.fromkeys((r["rig"], r["experiment"]) for r in records):
        own = [r for r in records if (r["rig"], r["experiment"]) == key and r["method"] == "prediction-error"]
        if not own:
            continue
        weight = np.array([r["seeds"] for r in own], dtype=float)
        square = np.average([r["ratio"] ** 2 for r in own], axis=0, weights=weight)
        coverage = float(np.average([np.mean(r["coverage"]) for r in own], weights=weight))
        cells_ = " | ".join(f"{x:.2f}" for x in np.sqrt(square))
        rows.append(
            f"| {key[0]}, {key[1]} | {int(weight.sum())} | {cells_} | {np.sqrt(square.mean()):.2f} | {coverage:.3f} |"
        )
    return "\n".join(rows)


def chance(seeds: int, level: float = 0.999) -> float:
    """What RMSE / bound an estimator at the bound exceeds with probability 1 − level, from so many logs."""
    return float(np.sqrt(chi2.ppf(level, seeds) / seeds))


def verdict(records: Sequence[dict[str, Any]]) -> str:
    """What of the prediction-error method misses the bar by more than chance, cell by cell."""
    lines = []
    for r in records:
        if r["method"] != "prediction-error":
            continue
        limit = max(BAR, chance(r["seeds"])) if r["seeds"] else BAR
        high = [f"θ{i + 1} {v:.2f}" for i, v in enumerate(r["ratio"]) if not v <= limit]
        far = BIAS + 2.33 / np.sqrt(max(r["seeds"], 1))
        biased = [f"θ{i + 1} {v:+.2f}" for i, v in enumerate(r["bias"] / r["bound"]) if not abs(v) <= far]
        coverage = float(np.mean(r["coverage"]))
        least = COVERAGE[0] - 3.0 * np.sqrt(0.05 * 0.95 / max(r["seeds"], 1))  # the nine of a log go together
        if high or biased or not coverage >= least:
            lines.append(
                f"- {r['case']}: RMSE / bound above {limit:.2f}: {', '.join(high) or 'none'}; bias / bound beyond "
                f"{far:.2f}: {', '.join(biased) or 'none'}; coverage {coverage:.3f}"
            )
    none = f"- none: no θ of any cell is above {BAR} × bound (0.1 %), or biased by {BIAS} × bound (1 %), beyond chance"
    return "\n".join(lines) or none


def plot(records: Sequence[dict[str, Any]], path: Path) -> None:
    """RMSE over bound of every θ (above) and coverage (below), a column a cell, prediction error only."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    own = [r for r in records if r["method"] == "prediction-error"]
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(10, 6.5), sharex=True, layout="constrained")
    for i, r in enumerate(own):
        x = i + np.linspace(-0.3, 0.3, 9)
        top.scatter(x, r["ratio"], s=14, c=np.arange(9), cmap="viridis")
        bottom.scatter(x, r["coverage"], s=14, c=np.arange(9), cmap="viridis")
    top.axhspan(0, BAR, color="tab:green", alpha=0.1)
    top.set(ylabel="RMSE / Cramér–Rao bound", ylim=(0, None))
    bottom.axhspan(*COVERAGE, color="tab:green", alpha=0.1)
    bottom.set(ylabel="coverage of 95 % intervals", ylim=(None, 1.02))
    names = [
        f"{r['rig']}\n{1e3 * r['T']:g} ms\n{r['counts']}" + ("\nhanging" * (r["experiment"] == "hanging")) for r in own
    ]
    bottom.set_xticks(range(len(own)), names, fontsize=7)
    figure.suptitle("Prediction error; in each column θ1 … θ9 from left to right", fontsize=10)
    with whole_file(path) as new:
        figure.savefig(new, dpi=130)
    plt.close(figure)
