"""Vision encoders whose every block is modulated by a condition vector (the instruction), FiLM.

FiLM: Perez et al. 2018. Spatial softmax: Levine et al. 2016. ResNet-18: He et al. 2016, with group normalisation
instead of batch normalisation, because moving averages of weights do not mix with running batch statistics.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from robocasa_lerobot.policies.common.transfer import is_plain_cpu

RESNET18_CHANNELS = (64, 128, 256, 512)  # two residual blocks each


class FiLM(nn.Module):
    """Scales and shifts channels: (1 + gamma) * x + beta, with beta and gamma linear in the condition."""

    def __init__(self, condition_dim: int, channels: int) -> None:
        super().__init__()
        self.to_shift_and_scale = nn.Linear(condition_dim, 2 * channels)

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        """Maps x (N, C, H, W) and condition (N, D) to (N, C, H, W)."""
        shift, scale = self.to_shift_and_scale(condition)[..., None, None].chunk(2, dim=1)
        return torch.addcmul(shift, x, 1.0 + scale)


class SpatialSoftmax(nn.Module):
    """Where in the picture each of a number of learned features is: expected coordinates in [-1, 1]."""

    def __init__(self, channels: int, keypoints: int) -> None:
        super().__init__()
        self.to_keypoints = nn.Conv2d(channels, keypoints, kernel_size=1)
        self.features = 2 * keypoints

    def forward(self, x: Tensor) -> Tensor:
        """Maps (N, C, H, W) to (N, 2 * keypoints), ordered x0, y0, x1, y1 ..."""
        heat = self.to_keypoints(x)
        height, width = heat.shape[-2:]
        weight = functional.softmax(heat.flatten(2), dim=-1).unflatten(2, (height, width))
        # Asked for twice, because PyTorch's ONNX exporter overlooks the first.
        xs = torch.linspace(-1.0, 1.0, width, device=x.device, dtype=weight.dtype).type_as(weight)
        ys = torch.linspace(-1.0, 1.0, height, device=x.device, dtype=weight.dtype).type_as(weight)
        expected_x = (weight.sum(dim=2) * xs).sum(dim=-1)
        expected_y = (weight.sum(dim=3) * ys).sum(dim=-1)
        return torch.stack([expected_x, expected_y], dim=-1).flatten(1)


class FeatureGrid(nn.Module):
    """Features of the cells of a coarse grid over a picture; tells small objects apart where few pictures train it."""

    def __init__(self, channels: int, cells: int) -> None:
        super().__init__()
        self.cells = cells  # of a side
        self.features = channels * cells**2

    def forward(self, x: Tensor) -> Tensor:
        """Maps (N, C, H, W) to (N, C * cells^2): the average of each cell."""
        if x.shape[-2:] != (self.cells, self.cells):
            x = functional.adaptive_avg_pool2d(x, self.cells)
        return x.flatten(1)


class ResidualBlock(nn.Module):
    """Basic block of ResNet-18 with group normalisation; FiLM after the residual sum, before its ReLU."""

    def __init__(self, in_channels: int, channels: int, stride: int, condition_dim: int | None) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(in_channels, channels, kernel_size=3, stride=stride, padding=1, bias=False)
        self.norm1 = _group_norm(channels)
        self.conv2 = nn.Conv2d(channels, channels, kernel_size=3, padding=1, bias=False)
        self.norm2 = _group_norm(channels)
        self.shortcut: nn.Module = nn.Identity()
        if stride != 1 or in_channels != channels:
            self.shortcut = nn.Sequential(
                nn.Conv2d(in_channels, channels, kernel_size=1, stride=stride, bias=False), _group_norm(channels)
            )
        self.film = FiLM(condition_dim, channels) if condition_dim else None

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        """Maps (N, C_in, H, W) to (N, C, H / stride, W / stride)."""
        y = functional.relu(self.norm1(self.conv1(x)))
        y = self.norm2(self.conv2(y)) + self.shortcut(x)
        if self.film is not None:
            y = self.film(y, condition)
        return functional.relu(y)


class ResNet18(nn.Module):
    """ResNet-18 without its classifier: 8 residual blocks, FiLM in each; 1/32 of the input's resolution."""

    def __init__(self, condition_dim: int | None) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            nn.Conv2d(3, RESNET18_CHANNELS[0], kernel_size=7, stride=2, padding=3, bias=False),
            _group_norm(RESNET18_CHANNELS[0]),
            nn.ReLU(),
            nn.MaxPool2d(kernel_size=3, stride=2, padding=1),
        )
        self.blocks = nn.ModuleList()
        previous = RESNET18_CHANNELS[0]
        for stage, channels in enumerate(RESNET18_CHANNELS):
            self.blocks.append(ResidualBlock(previous, channels, 1 if stage == 0 else 2, condition_dim))
            self.blocks.append(ResidualBlock(channels, channels, 1, condition_dim))
            previous = channels
        self.out_channels = previous

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        """Maps (N, 3, H, W) to (N, 512, H / 32, W / 32)."""
        x = self.stem(x)
        for block in self.blocks:
            x = block(x, condition)
        return x


class ConvNet(nn.Module):
    """A few strided convolutions with FiLM, for small images and for CPUs.

    The first has stride `stem`, each of the others halves the resolution. A stem of 4 takes 8x8 pixels, as in Mnih et
    al. 2015.
    """

    def __init__(self, channels: Sequence[int], condition_dim: int | None, stem: int = 2) -> None:
        super().__init__()
        self.convolutions, self.norms, self.films = nn.ModuleList(), nn.ModuleList(), nn.ModuleList()
        previous = 3
        for i, size in enumerate(channels):
            kernel, stride, padding = _first_convolution(stem) if i == 0 else (3, 2, 1)
            self.convolutions.append(nn.Conv2d(previous, size, kernel, stride=stride, padding=padding, bias=False))
            self.norms.append(nn.GroupNorm(size // 8, size))
            if condition_dim:
                self.films.append(FiLM(condition_dim, size))
            previous = size
        self.out_channels = previous

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        """Maps (N, 3, H, W) to (N, channels[-1], H / s, W / s), s = stem * 2^(n - 1)."""
        if is_plain_cpu(x.device):
            # A quarter faster, forth and back, in so shallow a network; ResNet-18 takes longer with it.
            x = x.contiguous(memory_format=torch.channels_last)
        for i, (convolution, norm) in enumerate(zip(self.convolutions, self.norms, strict=True)):
            x = norm(convolution(x))
            if self.films:
                x = self.films[i](x, condition)
            x = functional.relu(x)
        return x


class VisionEncoder(nn.Module):
    """A backbone, spatial softmax (or with `cells` a grid) and a linear layer: one feature vector per picture."""

    def __init__(self, backbone: ResNet18 | ConvNet, keypoints: int, features: int, cells: int | None = None) -> None:
        super().__init__()
        self.backbone = backbone
        channels = backbone.out_channels
        self.pool = SpatialSoftmax(channels, keypoints) if cells is None else FeatureGrid(channels, cells)
        self.project = nn.Linear(self.pool.features, features)

    def forward(self, images: Tensor, condition: Tensor) -> Tensor:
        """Maps images (N, 3, H, W) in [-1, 1] and condition (N, D) to (N, features), all >= 0."""
        return functional.relu(self.project(self.pool(self.backbone(images, condition))))


def _first_convolution(stride: int) -> tuple[int, int, int]:
    """Kernel, stride and padding: five pixels up to a stride of 2, twice the stride above it."""
    return (5, stride, 2) if stride <= 2 else (2 * stride, stride, stride // 2)


def _group_norm(channels: int) -> nn.GroupNorm:
    return nn.GroupNorm(channels // 16, channels)
