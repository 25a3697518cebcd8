"""A small z-buffer rasteriser for looking at people: numpy only."""

import numpy as np


class Picture:
    """Colour (H, W, 3), depth (H, W) along the optical axis, and the id of what is seen (H, W)."""

    def __init__(self, width, height, background=(0.93, 0.94, 0.95)):
        self.colour = np.empty((height, width, 3))
        self.colour[:] = background
        self.depth = np.full((height, width), np.inf)
        self.id = np.full((height, width), -1)

    def bytes(self):
        return (np.clip(self.colour, 0, 1) * 255 + 0.5).astype(np.uint8)


class Camera:
    """A pinhole at `eye` that looks along `ahead` (x forward, y left, z up); `focal` in pixels."""

    def __init__(self, eye, ahead, focal, up=(0, 0, 1), near=0.05):
        self.eye, self.focal, self.near = np.asarray(eye, float), focal, near
        z = np.asarray(ahead, float) / np.linalg.norm(ahead)
        x = np.cross(z, up)
        x /= np.linalg.norm(x)
        self.axes = np.stack([x, np.cross(z, x), z])

    def of(self, points):
        return (points - self.eye) @ self.axes.T


def at(eye, target):
    return np.asarray(target, float) - np.asarray(eye, float)


def draw(picture, camera, points, triangles, colours, ids, normals=None, light=(0.35, 0.5, 0.8)):
    """Draws triangles (T, 3) with a colour (T, 3) and an id (T,) each; both sides are seen."""
    height, width = picture.depth.shape
    light = np.asarray(light) / np.linalg.norm(light)
    seen = camera.of(points)
    corner = points[triangles]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-12)[:, None]
    for t, index in enumerate(triangles):
        p = seen[index]
        for poly, weights in _clipped(p, camera.near):
            _fill(
                picture, camera, poly, weights, index, colours[t], ids[t], flat[t], normals, light,
                width, height,
            )


def _clipped(p, near):
    """The part of a triangle beyond the near plane, as triangles with barycentric corners."""
    inside = p[:, 2] > near
    if inside.all():
        return [(p, np.eye(3))]
    if not inside.any():
        return []
    eye = np.eye(3)
    ring, weights = [], []
    for i in range(3):
        j = (i + 1) % 3
        if inside[i]:
            ring.append(p[i])
            weights.append(eye[i])
        if inside[i] != inside[j]:
            s = (near - p[i, 2]) / (p[j, 2] - p[i, 2])
            ring.append(p[i] + s * (p[j] - p[i]))
            weights.append(eye[i] + s * (eye[j] - eye[i]))
    ring, weights = np.array(ring), np.array(weights)
    return [(ring[[0, k, k + 1]], weights[[0, k, k + 1]]) for k in range(1, len(ring) - 1)]


def _fill(picture, camera, p, weights, index, colour, ident, flat, normals, light, width, height):
    z = p[:, 2]
    u = p[:, 0] / z * camera.focal + width / 2
    v = p[:, 1] / z * camera.focal + height / 2
    x0, x1 = max(int(np.floor(u.min())), 0), min(int(np.ceil(u.max())) + 1, width)
    y0, y1 = max(int(np.floor(v.min())), 0), min(int(np.ceil(v.max())) + 1, height)
    if x0 >= x1 or y0 >= y1:
        return
    area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
    if abs(area) < 1e-9:
        return
    gx, gy = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
    b0 = ((u[1] - gx) * (v[2] - gy) - (u[2] - gx) * (v[1] - gy)) / area
    b1 = ((u[2] - gx) * (v[0] - gy) - (u[0] - gx) * (v[2] - gy)) / area
    b2 = 1 - b0 - b1
    inverse = b0 / z[0] + b1 / z[1] + b2 / z[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = 1 / inverse
    window = (slice(y0, y1), slice(x0, x1))
    hit = (b0 >= 0) & (b1 >= 0) & (b2 >= 0) & (depth < picture.depth[window])
    if not hit.any():
        return
    if normals is None:
        normal = np.broadcast_to(flat, hit.shape + (3,))
    else:
        mix = (
            np.stack([b0 / z[0], b1 / z[1], b2 / z[2]], axis=-1) / inverse[..., None]
        ) @ weights
        normal = mix @ normals[index]
        normal = normal / np.maximum(np.linalg.norm(normal, axis=-1), 1e-9)[..., None]
    shade = normal @ light
    # Wrapped light, so that what turns away keeps some shape.
    bright = 0.42 + 0.58 * np.clip((shade + 0.35) / 1.35, 0, 1)
    picture.depth[window] = np.where(hit, depth, picture.depth[window])
    picture.id[window] = np.where(hit, ident, picture.id[window])
    picture.colour[window] = np.where(
        hit[..., None], np.asarray(colour) * bright[..., None], picture.colour[window]
    )
