"""Files of kinds that are not read: the message says what to do."""

import pytest

from identification import LogError, read_log


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("log.xlsx", "Save the sheet as CSV"),
        ("log.XLS", "Save the sheet as CSV"),
        ("log.h5", "numpy.savez"),
        ("log.json", r"read_json\(FILE\)"),
        ("log.jsonl", "lines=True"),
        ("log.pkl", "runs whatever is in it"),
        ("log.zip", "Unpack it"),
        ("log.tar.gz", "Unpack it"),
        ("log.db3", "metadata.yaml"),
        ("log.xyz", r"\.bag\.$"),
    ],
)
def test_what_to_do_with_a_file_of_another_kind(name, remedy, tmp_path):
    (tmp_path / name).write_bytes(b"PK")
    with pytest.raises(LogError, match=f"unknown ending.*{remedy}"):
        read_log(tmp_path / name)
