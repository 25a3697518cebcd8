"""Where the task's thing and goal are, found from the same tokens that actions are made
of. It is learned beside the actions and no part of what is served: who was made to say
where the mug is looks at the mug (auxiliary task; Jaderberg et al. 2016, and for
imitation by pictures Zhang et al. 2018, both in other forms)."""

import torch
import torch.nn.functional as F
from torch import nn

from network import STATE_TOKEN

POINTS = 2  # the thing and the goal
CELL = 32  # pixels of a token of the ResNet, each way
RARE = 8.0  # weight of the cell that has the point, beside one of those that have not


def width(cameras):
    """Numbers of a row of `aims`: for each point x, y, z, then u and v of each camera."""
    return POINTS * (3 + 2 * cameras)


class Aims(nn.Module):
    """Reads the encoder's tokens: place in the frame of the arm's base from that of the
    robot's state; for each token of a picture whether a point is in its cell, and where."""

    def __init__(self, shape, mean, deviation):
        super().__init__()
        self.cameras = shape.cameras
        self.space = nn.Linear(shape.dim, 3 * POINTS)
        self.cell = nn.Linear(shape.dim, POINTS)
        self.offset = nn.Linear(shape.dim, 2 * POINTS)
        nn.init.constant_(self.cell.bias, -3.0)  # few cells have a point
        self.register_buffer("mean", torch.as_tensor(mean))
        self.register_buffer("deviation", torch.as_tensor(deviation))

    def places(self, memory):
        """[B, points, 3], metres."""
        found = self.space(memory[:, STATE_TOKEN]).unflatten(-1, (POINTS, 3))
        return found.float() * self.deviation + self.mean

    def loss(self, memory, grid, places, pixels):
        """`grid`: rows and columns of cells; `places` [B, points, 3], metres, NaN for
        no such point; `pixels` [B, cameras, points, 2], x and y in the padded picture."""
        rows, columns = grid
        there = torch.isfinite(places).all(-1)  # [B, points]
        off = (self.places(memory) - places.nan_to_num()).abs() / self.deviation
        space = mean_of(off.mean(-1), there)

        seen = memory[:, memory.shape[1] - self.cameras * rows * columns :].unflatten(1, (self.cameras, -1))
        at = pixels.nan_to_num(-1e6) / CELL  # [B, cameras, points, 2]
        column, row = at.floor().unbind(-1)
        inside = there[:, None] & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        index = (row * columns + column).clamp(0, rows * columns - 1).long()  # [B, cameras, points]
        told = F.one_hot(index, rows * columns) * inside[..., None]  # [B, cameras, points, cells]
        logits = self.cell(seen).float().transpose(2, 3)
        told = told.to(logits.dtype)
        wrong = F.binary_cross_entropy_with_logits(logits, told, told * (RARE - 1) + 1, reduction="none")
        cell = mean_of(wrong.mean(-1), there[:, None].expand_as(inside))

        offset = self.offset(seen).float().unflatten(-1, (POINTS, 2)).transpose(2, 3)
        index = index[..., None, None].expand(*index.shape, 1, 2)
        offset = offset.gather(3, index).squeeze(3)
        off = (offset - (at - at.floor() - 0.5)).abs().mean(-1)
        return space + cell + mean_of(off, inside)


def mean_of(values, counts):
    return (values * counts).sum() / counts.sum().clamp(min=1)


def split_row(aims, cameras):
    """Places [N, points, 3] and shares of the picture [N, cameras, points, 2]."""
    points = aims.unflatten(-1, (POINTS, 3 + 2 * cameras))
    return points[..., :3], points[..., 3:].unflatten(-1, (cameras, 2)).transpose(1, 2)


def statistics(aims, cameras):
    """Mean and deviation [points, 3] of the places; the deviation 0.05 m at least."""
    places, _ = split_row(aims, cameras)
    there = torch.isfinite(places)
    count = there.sum(0).clamp(min=1)
    mean = places.nan_to_num().sum(0) / count
    square = ((places - mean).nan_to_num() ** 2).sum(0) / count
    return mean.cpu().numpy(), square.sqrt().clamp(min=0.05).cpu().numpy()
