"""Searches for the minima of the exact gap by dense sampling, beside which the compiled search is judged."""

import numpy as np

from models.contact_bodies import curve_pieces, surface_pieces
from models.exact_geometry import COLUMNS, MAX_CONTACTS, edge_gap, find_minima, is_nearest, planar_gap, pose_of, rim_gap
from models.section import SPAN, on_piece

SAMPLES, MINIMA, REFINEMENTS = 192, 4, 12


def found_minima(bodies, p, R, reach):
    """The rows (n, COLUMNS) of the compiled search for all mates of a pose, points and normals from their mouths."""
    rows, found = np.empty((MAX_CONTACTS, COLUMNS)), []
    for mate in range(len(bodies.mates)):
        count = find_minima(bodies, mate, pose_of(p, R), reach, rows)
        found.append(rows[:count].copy())
    return np.concatenate(found)


def sampled_minima(mate, p, R):
    """The lowest local minima (n, m) of the gaps of poses on the rim and on both edges, and the lowest on the floor."""
    p = p + R @ mate.tip - mate.mouth
    u, v = R[:, None, :, 0], R[:, None, :, 1]
    walls, sides = surface_pieces(mate.hole, inside=True), surface_pieces(mate.peg, inside=False)

    def on_rim(piece, share):
        x, y = on_piece(piece, share)
        return np.moveaxis(p[:, None] + x[..., None] * u + y[..., None] * v, -1, 0)

    def to_wall(piece, k, share):
        x, y, z = on_rim(piece, share)
        gap = rim_gap(mate.chamfer, *planar_gap(walls[k], x, y), z)[0]
        return np.where(is_nearest(walls, 0, len(walls), k, x, y), gap, np.inf)

    def to_floor(piece, share):
        return on_rim(piece, share)[2] + mate.depth

    def to_side(piece, height, k, share):
        x, y = on_piece(piece, share)
        d = np.stack([x, y, np.full_like(x, height)], axis=-1) - p[:, None]
        gap = edge_gap(sides[k], *np.moveaxis(d, -1, 0), *np.moveaxis(u, -1, 0), *np.moveaxis(v, -1, 0))[0]
        return np.where(is_nearest(sides, 0, len(sides), k, (d * u).sum(axis=-1), (d * v).sum(axis=-1)), gap, np.inf)

    found = []
    for piece in curve_pieces(mate.peg):
        found += [minima(lambda share, k=k: to_wall(piece, k, share), piece, len(p)) for k in range(len(walls))]  # noqa: B023
    for outline, height in ((mate.hole.offset(mate.chamfer), 0.0), (mate.hole, -mate.chamfer)):
        for piece in curve_pieces(outline):
            for k in range(len(sides)):
                found.append(minima(lambda share, k=k: to_side(piece, height, k, share), piece, len(p)))  # noqa: B023
    floor = [minima(lambda share: to_floor(piece, share), piece, len(p)) for piece in curve_pieces(mate.peg)]  # noqa: B023
    return np.concatenate(found, axis=1), np.concatenate(floor, axis=1).min(axis=1)


def minima(gap, piece, n):
    """The lowest local minima (n, MINIMA) of a gap along a piece, infinite where there are fewer."""
    closed = abs(piece[SPAN]) >= 2.0 * np.pi
    grid = np.linspace(0.0, 1.0, SAMPLES, endpoint=not closed)
    values = gap(np.broadcast_to(grid, (n, SAMPLES)))
    ends = {"mode": "wrap"} if closed else {"constant_values": np.inf}
    beside = np.pad(values, ((0, 0), (1, 1)), **ends)
    ranked = np.where((values <= beside[:, :-2]) & (values < beside[:, 2:]), values, np.inf)
    best = np.argsort(ranked, axis=1)[:, :MINIMA]
    found, centre, width = np.take_along_axis(ranked, best, axis=1), grid[best], grid[1]
    for _ in range(REFINEMENTS if np.isfinite(found).any() else 0):
        share = centre[..., None] + width * np.linspace(-1.0, 1.0, 9)
        share = share if closed else np.clip(share, 0.0, 1.0)
        values = gap(share.reshape(n, -1)).reshape(share.shape)
        centre = np.take_along_axis(share, values.argmin(axis=-1)[..., None], axis=-1)[..., 0]
        found, width = np.where(np.isfinite(found), values.min(axis=-1), np.inf), 0.25 * width
    return found


def lowest_gaps(assembly, p, R):
    """The lowest gaps (n,) of poses."""
    found = [sampled_minima(mate, p, R) for mate in assembly.mates]
    return np.min([np.minimum(gaps.min(axis=1), floor) for gaps, floor in found], axis=0)
