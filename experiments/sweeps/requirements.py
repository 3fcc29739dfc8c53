"""What a worker must have to do the work of a client: the same code and the same packages."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from experiments.provenance import version_of
from experiments.sweeps.code_digest import first_digest
from experiments.sweeps.policies import named_packages, own_modules
from experiments.sweeps.specification import PolicyPlan
from experiments.sweeps.trial_rows import engine_versions, trial_modules


@dataclass(frozen=True)
class Requirements:
    """The code and the packages of the client.

    Attributes:
        modules: names of all modules that the work may import.
        code: digest of their source.
        versions: names and versions of Python and of packages.
    """

    modules: tuple[str, ...]
    code: str
    versions: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, engine: str, own: Iterable[str] = (), packages: Iterable[str] = ()) -> Requirements:
        """Returns what work with an engine requires, with modules of the user's own and installed packages."""
        modules = tuple(sorted({*trial_modules(), *own}))
        versions = engine_versions(engine) | {name: version_of(name) for name in packages}
        return cls(modules, first_digest(modules), tuple(versions.items()))

    @classmethod
    def of_policy(cls, engine: str, plan: PolicyPlan) -> Requirements:
        """Returns what making or running a policy with an engine requires."""
        return cls.of(engine, own_modules(plan), named_packages(plan))

    def check(self) -> None:
        """Checks that this process has the same.

        Raises:
            ValueError: if it has other code, or another version of a package.
        """
        if first_digest(self.modules) != self.code:
            raise ValueError("a worker has other code than the client; install the same revision, or start again")
        for name, version in self.versions:
            if version_of(name) != version:
                raise ValueError(f"a worker has {name} {version_of(name)}, the client {version}; install the same")
