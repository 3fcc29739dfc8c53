"""Checks that the simulated contact keeps the play of peg and hole: its stiffness, and the facets of its meshes.

The pressure of the hydroelastic contact is the modulus E times the depth over the radius r, so that bodies of one shape
overlap by delta = k r (F / (E r^2))^n under a load F. Exponent and factor are those of a peg in two-point contact with
a tilt of 1 degree. Measured with r = 10 mm (docs/physics.md, "Convergence"), in um under 5 and 50 N: 56, 163 at
E = 1e8 Pa; 22.4, 58 at 1e9 Pa; 9.2, 21.6 at 1e10 Pa; 1.6, 4.0 at 5.5e11 Pa. The law agrees with these to 20 %; it is
best between 1e9 and 1e10 Pa, where contacts begin to be too soft.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from models.meshes import MAX_PLAY_ERROR, facet_sagitta, minimum_facets
from models.validation import Violation

OVERLAP_FACTOR = 0.121
OVERLAP_EXPONENT = 0.4

STATED_LOAD = 10.0
"""Load for which a contact must be stiff enough, N; above it the force guard reduces the feed by default. Most samples
of a good demonstration are below."""


def expected_overlap(*, modulus: float, peg_radius: float, load: float = STATED_LOAD) -> float:
    """Returns the expected overlap (m) of peg and bore.

    Args:
        modulus: Hydroelastic modulus E, Pa.
        peg_radius: Radius r of the peg, m.
        load: Load F of the contact, N.
    """
    return float(OVERLAP_FACTOR * peg_radius * (load / (modulus * peg_radius**2)) ** OVERLAP_EXPONENT)


def softest_modulus(*, clearance: float, peg_radius: float, load: float = STATED_LOAD) -> float:
    """Returns the modulus (Pa) at which the expected overlap equals the radial clearance (m).

    With a softer contact the bodies pass through each other: the peg then fits into the hole at any tilt.
    """
    return float(load / peg_radius**2 * (OVERLAP_FACTOR * peg_radius / clearance) ** (1.0 / OVERLAP_EXPONENT))


def softness_violations(*, modulus: float, clearance: float, peg_radius: float) -> Iterator[Violation]:
    """Checks that the contact keeps peg and bore apart under the stated load; see `softest_modulus`."""
    softest = softest_modulus(clearance=clearance, peg_radius=peg_radius)
    if modulus < softest:
        overlap = 1e6 * expected_overlap(modulus=modulus, peg_radius=peg_radius)
        yield Violation(
            "contact.modulus",
            f"{modulus} Pa (an overlap of {overlap:.3g} um under {STATED_LOAD:.0f} N)",
            f"at least {softest:.2g} Pa: the bodies pass through each other if they overlap by more than the clearance"
            f" of {1e6 * clearance:.3g} um",
        )


def facet_violations(*, facets: int, radius: float, clearance: float, spins: bool) -> Iterator[Violation]:
    """Checks that peg and bore have enough facets for their play.

    Args:
        facets: Number of facets n.
        radius: Radius of the bore, m.
        clearance: R - r, m.
        spins: Whether the peg may rotate about its axis (see `minimum_facets`). If not, the corners stay aligned, and
            fewer facets are enough if the play, which is wrong by the part 1 - cos(pi/n) of the clearance, is
            wrong by less than `MAX_PLAY_ERROR`.
    """
    spinning = minimum_facets(radius, clearance)
    minimum = spinning if spins else min(spinning, math.ceil(math.pi / math.acos(1.0 - MAX_PLAY_ERROR)))
    if facets >= minimum:
        return
    found = f"play wrong by {100 * facet_sagitta(1.0, facets):.2g} %"
    bound = f"the play is wrong by < {MAX_PLAY_ERROR:.0%}"
    if minimum == spinning:
        found = f"sagitta {1e6 * facet_sagitta(radius, facets):.1f} um"
        bound = f"the sagitta is below a quarter of the clearance ({1e6 * clearance / 4:.1f} um)"
    reason = "; with fixture free the peg may rotate about its axis" if spins else ""
    yield Violation("geometry.facets", f"{facets} ({found})", f"at least {minimum}, so that {bound}{reason}")
