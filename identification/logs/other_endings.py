"""Files that hold logs and are not read: what their owner can do."""

_SHEET = "Save the sheet as CSV; semicolons and decimal commas are read."
_COLUMNS = "Write its columns to an .npz file: numpy.savez('log.npz', t=..., q1=..., q2=..., u=...)."
_JSON = "Write it as CSV: pandas.read_json(FILE).to_csv('log.csv', index=False)."
_LINES = "Write it as CSV: pandas.read_json(FILE, lines=True).to_csv('log.csv', index=False)."
_PICKLE = f"Loading a pickle runs whatever is in it. {_COLUMNS}"

REMEDIES: dict[str, str] = {
    **dict.fromkeys((".xlsx", ".xlsm", ".xls", ".ods", ".numbers"), _SHEET),
    **dict.fromkeys((".h5", ".hdf5", ".hdf", ".npy"), _COLUMNS),
    ".json": _JSON,
    **dict.fromkeys((".jsonl", ".ndjson"), _LINES),
    **dict.fromkeys((".pkl", ".pickle", ".joblib"), _PICKLE),
    **dict.fromkeys(
        (".zip", ".7z", ".rar", ".tar", ".tgz", ".gz", ".bz2", ".xz"), "Unpack it, and give the log in it."
    ),
    ".db3": "Give the folder that holds it and metadata.yaml.",
}
"""By ending, in small letters."""
