"""Auxiliary task: locate the task's object and goal from the encoder's tokens.

The head is trained together with the actions and is not part of a served policy. A network
that must locate the mug attends to the mug (Jaderberg et al. 2016, and for imitation from
images Zhang et al. 2018, both in other forms)."""

import torch
import torch.nn.functional as F
from torch import nn

from network import STATE_TOKEN

POINTS = 2  # the object and the goal
CELL = 32  # side of a token of the ResNet, pixels
POSITIVE_WEIGHT = 8.0  # weight of the cell with the point, relative to a cell without it


def row_width(cameras):
    """Numbers of a row of the tensor `aims`: for each point x, y, z, then u and v of each camera."""
    return POINTS * (3 + 2 * cameras)


class KeypointHead(nn.Module):
    """Predicts positions in the frame of the arm's base from the token of the robot's state, and
    for each image token whether a point is in its cell, and its offset."""

    def __init__(self, shape, mean, deviation):
        super().__init__()
        self.cameras = shape.cameras
        self.space = nn.Linear(shape.dim, 3 * POINTS)
        self.cell = nn.Linear(shape.dim, POINTS)
        self.offset = nn.Linear(shape.dim, 2 * POINTS)
        nn.init.constant_(self.cell.bias, -3.0)  # few cells contain a point
        self.register_buffer("mean", torch.as_tensor(mean))
        self.register_buffer("deviation", torch.as_tensor(deviation))

    def positions(self, memory):
        """Positions of the points [B, points, 3], metres."""
        found = self.space(memory[:, STATE_TOKEN]).unflatten(-1, (POINTS, 3))
        return found.float() * self.deviation + self.mean

    def loss(self, memory, grid, positions, pixels):
        """`grid`: rows and columns of cells; `positions` [B, points, 3], metres, NaN for an absent
        point; `pixels` [B, cameras, points, 2], x and y in the padded image."""
        rows, columns = grid
        present = torch.isfinite(positions).all(-1)  # [B, points]
        off = (self.positions(memory) - positions.nan_to_num()).abs() / self.deviation
        space = masked_mean(off.mean(-1), present)

        tokens = memory[:, memory.shape[1] - self.cameras * rows * columns :].unflatten(1, (self.cameras, -1))
        at = pixels.nan_to_num(-1e6) / CELL  # [B, cameras, points, 2]
        column, row = at.floor().unbind(-1)
        inside = present[:, None] & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        index = (row * columns + column).clamp(0, rows * columns - 1).long()  # [B, cameras, points]
        target = F.one_hot(index, rows * columns) * inside[..., None]  # [B, cameras, points, cells]
        logits = self.cell(tokens).float().transpose(2, 3)
        target = target.to(logits.dtype)
        weight = target * (POSITIVE_WEIGHT - 1) + 1
        entropy = F.binary_cross_entropy_with_logits(logits, target, weight, reduction="none")
        cell = masked_mean(entropy.mean(-1), present[:, None].expand_as(inside))

        offset = self.offset(tokens).float().unflatten(-1, (POINTS, 2)).transpose(2, 3)
        index = index[..., None, None].expand(*index.shape, 1, 2)
        offset = offset.gather(3, index).squeeze(3)
        off = (offset - (at - at.floor() - 0.5)).abs().mean(-1)
        return space + cell + masked_mean(off, inside)


def masked_mean(values, counts):
    return (values * counts).sum() / counts.sum().clamp(min=1)


def split_row(aims, cameras):
    """Positions [N, points, 3], metres, and image coordinates [N, cameras, points, 2], as shares of the sides."""
    points = aims.unflatten(-1, (POINTS, 3 + 2 * cameras))
    return points[..., :3], points[..., 3:].unflatten(-1, (cameras, 2)).transpose(1, 2)


def statistics(aims, cameras):
    """Mean and standard deviation [points, 3] of the positions, metres; the deviation is at least 0.05 m."""
    positions, _ = split_row(aims, cameras)
    present = torch.isfinite(positions)
    count = present.sum(0).clamp(min=1)
    mean = positions.nan_to_num().sum(0) / count
    square = ((positions - mean).nan_to_num() ** 2).sum(0) / count
    return mean.cpu().numpy(), square.sqrt().clamp(min=0.05).cpu().numpy()
