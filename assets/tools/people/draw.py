"""A small z-buffer rasterizer to view people; needs only numpy."""

import numpy as np


class Canvas:
    """Color (H, W, 3), depth (H, W) along the optical axis, and id of the visible triangle (H, W)."""

    def __init__(self, width, height, background=(0.93, 0.94, 0.95)):
        self.color = np.empty((height, width, 3))
        self.color[:] = background
        self.depth = np.full((height, width), np.inf)
        self.id = np.full((height, width), -1)

    def bytes(self):
        return (np.clip(self.color, 0, 1) * 255 + 0.5).astype(np.uint8)


class Camera:
    """A pinhole camera at `eye` with direction `ahead` (x forward, y left, z up); `focal` in pixels."""

    def __init__(self, eye, ahead, focal, up=(0, 0, 1), near=0.05):
        self.eye, self.focal, self.near = np.asarray(eye, float), focal, near
        z = np.asarray(ahead, float) / np.linalg.norm(ahead)
        x = np.cross(z, up)
        x /= np.linalg.norm(x)
        self.axes = np.stack([x, np.cross(z, x), z])

    def project(self, points):
        return (points - self.eye) @ self.axes.T


def at(eye, target):
    return np.asarray(target, float) - np.asarray(eye, float)


def draw(canvas, camera, points, triangles, colors, ids, normals=None, light=(0.35, 0.5, 0.8)):
    """Renders triangles (T, 3) with a color (T, 3) and an id (T,) each; both sides are visible."""
    height, width = canvas.depth.shape
    light = np.asarray(light) / np.linalg.norm(light)
    projected = camera.project(points)
    corner = points[triangles]
    flat = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-12)[:, None]
    for t, index in enumerate(triangles):
        p = projected[index]
        for poly, weights in _clip(p, camera.near):
            _fill(
                canvas, camera, poly, weights, index, colors[t], ids[t], flat[t], normals, light,
                width, height,
            )


def _clip(p, near):
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


def _fill(canvas, camera, p, weights, index, color, ident, flat, normals, light, width, height):
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
    hit = (b0 >= 0) & (b1 >= 0) & (b2 >= 0) & (depth < canvas.depth[window])
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
    # Wrapped light, so that surfaces away from the light keep some shading.
    bright = 0.42 + 0.58 * np.clip((shade + 0.35) / 1.35, 0, 1)
    canvas.depth[window] = np.where(hit, depth, canvas.depth[window])
    canvas.id[window] = np.where(hit, ident, canvas.id[window])
    canvas.color[window] = np.where(
        hit[..., None], np.asarray(color) * bright[..., None], canvas.color[window]
    )
