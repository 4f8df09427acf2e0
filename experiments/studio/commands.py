"""The command lines that do what the page does."""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from furuta_gym.plant import Effect, Plant
from furuta_gym.sensors import Sensors

from .loop import Conditions
from .session import Session


def files(session: Session) -> str:
    """The logs, as they are typed; dropped ones by their name."""
    return " ".join(shlex.quote(_typed(path, session)) for path in session.paths) or "LOG"


def _typed(path: Path, session: Session) -> str:
    if path.resolve().is_relative_to(session.folder.resolve()):
        return os.fspath(path.resolve().relative_to(session.folder.resolve()))
    return path.name if session.was_dropped(path) else os.fspath(path)


def _reading(session: Session) -> str:
    options = session.proposal.mapping.options() if session.proposal else ""
    return "".join(f" {said}" for said in (options, _no_file(session)) if said)


def _no_file(session: Session) -> str:
    """What keeps a rig.toml beside the logs from adding to the options, where the page was told how to read them."""
    return "" if session.stated is None else "--mapping none"


def init(session: Session) -> str:
    options = (session.given.options(), _no_file(session))
    return f"furuta init {files(session)}" + "".join(f" {said}" for said in options if said) + " --yes"


def identify(session: Session, out: str = "rig.json") -> str:
    return f"furuta identify {files(session)}{_reading(session)} -o {out}"


def validate(session: Session, plant: str = "rig.json") -> str:
    return f"furuta validate {plant} {files(session)}{_reading(session)}"


def diagnose(session: Session, out: str = "diagnosis") -> str:
    return f"furuta diagnose {files(session)}{_reading(session)} -o {out}"


def residuals(session: Session, out: str = "residuals") -> str:
    return f"furuta residuals {files(session)}{_reading(session)} -o {out}"


def excite(plant: str = "rig.json") -> str:
    return f"furuta excite --plant {plant} -o u.csv"


def effect_text(effect: Effect) -> str:
    """An effect as `--effect` takes it."""
    return f"{effect.name}:" + ",".join(f"{name}={value:.6g}" for name, value in effect.parameters.items())


def closed_loop(plant: str, base: Plant, controller: str, conditions: Conditions, trusted: bool = False) -> str:
    """The closed loop of the view Play, without the pushes of the hand. base: the plant of that file."""
    effects = "".join(f" --effect {shlex.quote(effect_text(e))}" for e in conditions.added(base))
    both = np.broadcast_to(conditions.sensors(Sensors.of_file(base.sensors)).noise_std, 2)
    noise = f" --noise {both[0]:.3g},{both[1]:.3g}" if conditions.noise > 0 else ""
    trust = " --trust" if trusted else ""
    return (
        f"furuta simulate --plant {plant} --design-plant {plant} --controller {shlex.quote(controller)}{trust}"
        f"{effects}{noise} --duration 10 -o closed_loop.csv"
    )


def what_if(session: Session, plant: Plant) -> str:
    """What measures the plant on the logs, where a file holds it; else "": sliders have no options of the shell."""
    if session.kept is not None and plant == session.kept:
        return validate(session, "what_if.json")
    return validate(session) if session.estimate is not None and plant == session.estimate.plant else ""


def script(session: Session, lines: Sequence[str]) -> str:
    """A shell script of the steps that were done."""
    return "\n".join(["#!/bin/sh", "set -e", *lines, ""])
