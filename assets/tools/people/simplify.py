"""Reduces the triangles of a mesh, with the same choice for all bodies and postures.

Edges are collapsed onto one of their ends in the order of the quadric error (Garland and
Heckbert 1997), summed over several shapes of the same mesh: bodies, at rest and seated.
So the remaining vertices are vertices of the source, with their weights, and knees and
fingers keep enough vertices to bend.
"""

import heapq

import numpy as np

# Weight of a plane along a border (of the mesh, or between materials) against a face's.
BORDER = 30.0
# Least cosine between the normals of a triangle before and after a collapse.
FLIP = 0.35
# Least shape of a new triangle: twice its area over the square of its longest edge.
SLENDER = 0.04


def simplify_mesh(shapes, triangles, labels, budget, importance=None):
    """Triangles (M, 3) with labels (M,), at most about `budget`, on the same vertices.

    `shapes`: places of the vertices in each shape (K, N, 3). `labels`: material of each
    triangle (T,). `importance`: factor of the error at each vertex (N,).
    """
    count = shapes.shape[1]
    importance = np.ones(count) if importance is None else importance
    faces = {k: tuple(int(v) for v in t) for k, t in enumerate(triangles)}
    around = {}
    for k, face in faces.items():
        for v in face:
            around.setdefault(v, set()).add(k)
    quadrics = _face_quadrics(shapes, triangles)
    borders = _borders(triangles, labels)
    _border_quadrics(shapes, triangles, borders, quadrics)
    on_border = {}
    for a, b in borders:
        on_border.setdefault(a, set()).add(b)
        on_border.setdefault(b, set()).add(a)
    homogeneous = np.concatenate([shapes, np.ones(shapes.shape[:2] + (1,))], axis=2)
    homogeneous = homogeneous.transpose(1, 0, 2).copy()  # (N, K, 4)
    places = shapes.transpose(1, 0, 2).copy()  # (N, K, 3)
    stamp = np.zeros(count, int)
    heap = []

    def neighbours(v):
        return {w for k in around[v] for w in faces[k]} - {v}

    def offer(u, v):
        h = homogeneous[v]
        error = float(np.einsum("ki,kij,kj->", h, quadrics[u] + quadrics[v], h))
        heapq.heappush(heap, (error * importance[u], u, v, stamp[u], stamp[v]))

    for a, b in sorted(_edges(triangles)):
        offer(a, b)
        offer(b, a)

    alive = len(faces)
    while alive > budget and heap:
        _, u, v, stamp_u, stamp_v = heapq.heappop(heap)
        if stamp[u] != stamp_u or stamp[v] != stamp_v or u not in around or v not in around:
            continue
        shared = around[u] & around[v]
        if not shared:
            continue
        mine = on_border.get(u, set())
        if mine and (v not in mine or len(mine) != 2):
            continue
        if len(neighbours(u) & neighbours(v)) != len(shared):
            continue
        moved = [k for k in around[u] if k not in shared]
        if not _keeps_shape(places, [faces[k] for k in moved], u, v):
            continue
        for k in shared:
            for w in faces[k]:
                around[w].discard(k)
            del faces[k]
        alive -= len(shared)
        for k in moved:
            faces[k] = tuple(v if w == u else w for w in faces[k])
            around[v].add(k)
        del around[u]
        quadrics[v] += quadrics[u]
        if mine:
            (other,) = mine - {v}
            on_border[v].discard(u)
            on_border[other].discard(u)
            on_border[v].add(other)
            on_border[other].add(v)
            del on_border[u]
        stamp[v] += 1
        for w in sorted(neighbours(v)):
            offer(w, v)
            offer(v, w)
    keys = sorted(faces)
    return np.array([faces[k] for k in keys]), np.asarray(labels)[keys]


def _keeps_shape(places, faces, u, v):
    """Whether no triangle flips or becomes too slender in any shape."""
    if not faces:
        return True
    old = np.array(faces)
    new = np.where(old == u, v, old)

    def normal(index):
        a, b, c = (places[index[:, i]] for i in range(3))
        edges = np.stack([b - a, c - b, a - c])
        longest = (edges**2).sum(axis=-1).max(axis=0)
        return np.cross(edges[0], -edges[2]), longest

    before, longest_before = normal(old)
    after, longest_after = normal(new)
    size = np.linalg.norm(before, axis=-1) * np.linalg.norm(after, axis=-1)
    if ((before * after).sum(axis=-1) < FLIP * size).any():
        return False
    shape_before = np.linalg.norm(before, axis=-1) / longest_before
    shape_after = np.linalg.norm(after, axis=-1) / longest_after
    return not ((shape_after < SLENDER) & (shape_after < shape_before)).any()


def _face_quadrics(shapes, triangles):
    quadrics = np.zeros((shapes.shape[1], shapes.shape[0], 4, 4))
    for s, points in enumerate(shapes):
        a, b, c = (points[triangles[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        twice = np.linalg.norm(normal, axis=1)
        normal /= np.maximum(twice, 1e-15)[:, None]
        plane = np.concatenate([normal, -(normal * a).sum(axis=1)[:, None]], axis=1)
        outer = plane[:, :, None] * plane[:, None, :] * (twice / 6)[:, None, None]
        for i in range(3):
            np.add.at(quadrics[:, s], triangles[:, i], outer)
    return quadrics


def _edges(triangles):
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return {(int(a), int(b)) for a, b in np.sort(edges, axis=1)}


def _borders(triangles, labels):
    """Edges with one triangle, or between two materials."""
    by_edge = {}
    for t, face in enumerate(triangles):
        for i in range(3):
            a, b = int(face[i]), int(face[(i + 1) % 3])
            by_edge.setdefault((min(a, b), max(a, b)), []).append(t)
    return {
        edge: of
        for edge, of in sorted(by_edge.items())
        if len(of) != 2 or labels[of[0]] != labels[of[1]]
    }


def _border_quadrics(shapes, triangles, borders, quadrics):
    for (a, b), of in borders.items():
        for s, points in enumerate(shapes):
            along = points[b] - points[a]
            for t in of:
                p, q, r = points[triangles[t]]
                across = np.cross(along, np.cross(q - p, r - p))
                length = np.linalg.norm(across)
                if length < 1e-15:
                    continue
                across /= length
                plane = np.append(across, -(across @ points[a]))
                outer = np.outer(plane, plane) * BORDER * (along @ along)
                quadrics[a, s] += outer
                quadrics[b, s] += outer
