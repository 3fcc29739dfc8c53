"""Checks that the optional packages of a benchmark are installed, before an import fails with a traceback."""

from __future__ import annotations

from importlib.util import find_spec

EXTRAS = {
    **dict.fromkeys(("pydrake", "yaml"), "sim"),
    **dict.fromkeys(("hmmlearn", "mujoco", "ruptures"), "peers"),
    **{"gymnasium": "gym", "lerobot": "lerobot", "stable_baselines3": "rl"},
}
"""The extra of this project that installs each optional package."""


def require_packages(*packages: str) -> None:
    """Ends the process with one line and exit code 1 if one of the packages is not installed.

    Args:
        packages: names of optional packages, as imported; each must be in `EXTRAS`.
    """
    missing = sorted({EXTRAS[package] for package in packages if not _is_installed(package)})
    if missing:
        noun = "extra" if len(missing) == 1 else "extras"
        names = ",".join(missing)
        raise SystemExit(f"error: this benchmark needs the {noun} [{names}]: pip install -e '.[{names}]'")


def _is_installed(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except ModuleNotFoundError:
        return False
