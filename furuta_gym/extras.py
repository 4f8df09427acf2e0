"""How an extra of the package is installed, for messages."""


def install(extra: str) -> str:
    """The command, which is given in the clone: the package is on no index."""
    return f"pip install '.[{extra}]' in the clone"
