"""TDMS files, as LabVIEW writes them. Needs the extra `labview`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from furuta_gym.extras import install
from furuta_gym.files import in_short

from .checks import LogError
from .opening import check_cells
from .table import Table


def read_tdms(path: Path) -> Table:
    """Channels as columns, `group.channel` where there are several groups; time from the channels' own increment where
    no channel holds it. Raises LogError."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        message = f"{path.name}: TDMS files need the package npTDMS: {install('labview')}"
        raise LogError(message) from None
    try:
        with TdmsFile.open(path) as file:
            groups = file.groups()
            channels = [channel for group in groups for channel in group.channels() if len(channel)]
            check_cells(path.name, sum(len(channel) for channel in channels))
            several = len({channel.group_name for channel in channels}) > 1
            names = {c: f"{c.group_name}.{c.name}" if several else c.name for c in channels}
            columns = {names[c]: np.asarray(c[:]) for c in channels}
            units = {names[c]: str(c.properties.get("unit_string", "")) for c in channels}
            metadata = {key: str(value) for key, value in file.properties.items()}
            longest = max(channels, key=lambda channel: len(channel), default=None)
            step = float(longest.properties.get("wf_increment", 0.0)) if longest is not None else 0.0
            if longest is not None and step > 0 and not any(_rises(values) for values in columns.values()):
                columns = {"time": step * np.arange(len(longest))} | columns
                units["time"] = "s"
    except LogError:
        raise
    except Exception as error:  # of damaged files; the library raises half a dozen kinds
        said = in_short(" ".join(str(error).split()), 300) or type(error).__name__
        raise LogError(f"{path.name}: not a readable TDMS file ({said}).") from None
    return Table(path.name, columns, metadata, units={c: u for c, u in units.items() if u})


def _rises(values: np.ndarray) -> bool:
    """Whether a channel can be the clock."""
    if values.dtype.kind not in "fiuM" or len(values) < 2:
        return False
    return bool((np.diff(values) > np.zeros(1, dtype=np.diff(values[:2]).dtype)).all())
