"""When and with what a stage ran: kept in records beside the artifacts, never in their content."""

import datetime
import platform

from aatri import __version__


def now() -> str:
    """The time in UTC, ISO 8601, to the second."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def environment() -> dict[str, str]:
    """Versions that numbers may depend on, the system and the host."""
    import h5py
    import numpy as np
    import scipy

    return {
        "aatri": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
        "system": platform.platform(),
        "host": platform.node(),
    }
