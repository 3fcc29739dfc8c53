"""Searches for the minima of the exact gap by dense sampling, beside which the compiled search is judged."""

import numpy as np
from numba import njit

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


@njit
def wall_gaps(chamfer, walls, k, x, y, z):
    """The gaps (n,) of points on the rim to one piece of the hole, infinite where another one is nearer."""
    found = np.full(len(x), np.inf)
    for i in range(len(x)):
        if is_nearest(walls, 0, len(walls), k, x[i], y[i]):
            outside, r_x, r_y, size = planar_gap(walls[k], x[i], y[i])
            found[i] = rim_gap(chamfer, outside, r_x, r_y, size, z[i])[0]
    return found


@njit
def side_gaps(sides, k, d, u, v):
    """The gaps (n,) of points d (n, 3) from the tip to one side of a peg with the axes u and v, likewise."""
    found = np.full(len(d), np.inf)
    for i in range(len(d)):
        if is_nearest(sides, 0, len(sides), k, (d[i] * u[i]).sum(), (d[i] * v[i]).sum()):
            x, y, z = d[i]
            u_x, u_y, u_z = u[i]
            v_x, v_y, v_z = v[i]
            found[i] = edge_gap(sides[k], x, y, z, u_x, u_y, u_z, v_x, v_y, v_z)[0]
    return found


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
        return wall_gaps(mate.chamfer, walls, k, x.ravel(), y.ravel(), z.ravel()).reshape(x.shape)

    def to_floor(piece, share):
        return on_rim(piece, share)[2] + mate.depth

    def to_side(piece, height, k, share):
        x, y = on_piece(piece, share)
        d = np.stack([x, y, np.full_like(x, height)], axis=-1) - p[:, None]
        rows = [np.broadcast_to(a, d.shape).reshape(-1, 3) for a in (d, u, v)]
        return side_gaps(sides, k, *rows).reshape(x.shape)

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
