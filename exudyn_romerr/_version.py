"""Version of the package; pyproject.toml has the same one."""

__version__ = "0.3.0"
