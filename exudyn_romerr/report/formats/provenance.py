"""Date, script and versions that a report was made with."""

import platform
import sys
from datetime import datetime, timezone

from ..._version import __version__

MODULES = ("numpy", "scipy", "exudyn")
SYSTEM = platform.platform()  # it starts a program, which is better done here than within a solve


def made_here() -> dict[str, str]:
    """Return date, script and versions of this process; Exudyn's only if it is loaded."""
    loaded = {name: sys.modules[name] for name in MODULES if sys.modules.get(name) is not None}
    return {
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC"),
        "script": sys.argv[0] if sys.argv[0] not in ("", "-", "-c") else "interactive session",
        "system": SYSTEM,
        "exudyn_romerr": __version__,
        "python": platform.python_version(),
        **{name: str(module.__version__) for name, module in loaded.items()},
    }
