"""What a worker must have to do the work of a client: the same code and the same packages."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from systems.runs.provenance import version_of
from systems.sweeps.code_digest import source_digest
from systems.sweeps.trial_rows import engine_versions, trial_modules


@dataclass(frozen=True)
class Requirements:
    """The code and the packages of the client.

    Attributes:
        modules: names of all modules that the work may import.
        code: digest of their source.
        versions: names and versions of packages.
    """

    modules: tuple[str, ...]
    code: str
    versions: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, engine: str, own: Iterable[str] = ()) -> Requirements:
        """Returns what work with an engine requires, with some modules of the user's own."""
        modules = tuple(sorted({*trial_modules(), *own}))
        versions = {name: version for name, version in engine_versions(engine).items() if name != "python"}
        return cls(modules, digest_here(modules), tuple(versions.items()))

    def check(self) -> None:
        """Checks that this process has the same.

        Raises:
            ValueError: if it has other code, or another version of a package.
        """
        if digest_here(self.modules) != self.code:
            raise ValueError("a worker has other code than the client; install the same revision, or start again")
        for name, version in self.versions:
            if version_of(name) != version:
                raise ValueError(f"a worker has {name} {version_of(name)}, the client {version}; install the same")


@lru_cache(maxsize=256)
def digest_here(modules: tuple[str, ...]) -> str:
    """The digest of modules as this process found them first. It does not follow imports: they are listed."""
    return source_digest(modules)
