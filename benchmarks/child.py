"""Tasks in processes of their own, with limits of time and memory: what they tell, and how far they come (Linux)."""

import json
import resource
import subprocess
import sys
from pathlib import Path
from typing import Any

LIMITS = (150.0, 8.0)  # s, GB


def resident(name: str) -> float:
    """Return VmRSS or VmHWM of this process in MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(name))


def tell(name: str, value: float) -> None:
    """Print a number to the parent process, which reads as far as this one comes."""
    print(json.dumps([name, value]), flush=True)


def child(script: str, *task: str, limits: tuple[float, float] | None = None) -> dict[str, Any]:
    """Run a script with --child and its task; return what it told, and how it ended if it did not end well.

    limits : seconds, and GB of address space; None: LIMITS.
    """
    seconds, gigabytes = limits or LIMITS
    command = [sys.executable, script, "--child", *task]
    limit = round(gigabytes * 1e9)
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
    )
    try:
        said, errors = process.communicate(timeout=seconds)
        last = errors.strip().splitlines()[-1:] or [f"ended with {process.returncode}"]
        ended = last[0] if process.returncode else ""
    except subprocess.TimeoutExpired:
        process.kill()
        said, _ = process.communicate()
        ended = f"not done within {seconds:g} s"
    lines = (line for line in said.splitlines() if line.startswith("["))
    return {**dict(map(json.loads, lines)), **({"ended": ended} if ended else {})}
