"""Textures generated from a record: wood, stone, tile, plaster, brushed metal. No image files are shipped.

A texture is a pure function of its record, so a recorded scene names its textures and anyone can make them again.
"""

from __future__ import annotations

import functools
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from robocasa_lerobot.envs.kept_files import kept, stamp
from robocasa_lerobot.errors import UnknownNameError

TEXTURE_SIZE = 256  # pixels, height and width

Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class TextureRecord:
    """What a generated texture is made from.

    Attributes:
        kind: a key of `GENERATORS`.
        rgb: main colour, components in [0, 1].
        rgb2: second colour (grain, veins, joints), components in [0, 1].
        seed: of the pattern.
        scale_m: edge length in metres that one repetition covers on a surface; 0 stretches it over the surface.
    """

    kind: str
    rgb: Rgb
    rgb2: Rgb
    seed: int = 0
    scale_m: float = 1.0

    @property
    def file(self) -> str:
        """File name that scenes give the texture; unique to the record."""
        colours = "".join(f"{round(c * 255):02x}" for c in (*self.rgb, *self.rgb2))
        return f"textures/{self.kind}_{colours}_{self.seed}.png"


@functools.cache
def _radius(stretch: tuple[float, float]) -> NDArray[np.float64]:
    """Length of each frequency of the half plane that a real picture needs, shape (size, size / 2 + 1)."""
    down = np.fft.fftfreq(TEXTURE_SIZE)[:, None] * TEXTURE_SIZE * stretch[0]
    across = np.fft.rfftfreq(TEXTURE_SIZE)[None, :] * TEXTURE_SIZE * stretch[1]
    radius = np.hypot(down, across)
    radius[0, 0] = 1.0
    return np.asarray(radius)


def _fourier_noise(rng: np.random.Generator, exponent: float, stretch: tuple[float, float]) -> NDArray[np.float64]:
    """Tileable power-law noise in [0, 1], shape (size, size); `stretch` > 1 elongates it along an axis."""
    radius = _radius(stretch)
    # White noise has a white spectrum: it is drawn there, which spares a transform.
    spectrum = rng.standard_normal((2, *radius.shape)) / radius**exponent
    spectrum[:, 0, 0] = 0.0
    noise = np.fft.irfft2(spectrum[0] + 1j * spectrum[1], s=(TEXTURE_SIZE, TEXTURE_SIZE))
    low, high = np.percentile(noise[::4, ::4], [1, 99])
    return np.clip((noise - low) / (high - low), 0.0, 1.0)


def _mix(rgb: Rgb, rgb2: Rgb, amount: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(rgb) * (1.0 - amount[..., None]) + np.asarray(rgb2) * amount[..., None]


def _wood(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Grain along the vertical axis: warped stripes with fine fibres."""
    warp = _fourier_noise(rng, 2.2, (6.0, 1.0))
    column = np.linspace(0.0, 1.0, TEXTURE_SIZE, endpoint=False)[None, :]
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (5 * column + 2.2 * warp))
    fibres = _fourier_noise(rng, 0.9, (14.0, 1.0))
    return _mix(record.rgb, record.rgb2, 0.55 * rings**2 + 0.35 * fibres)


def _stone(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Marble-like: soft clouds with thin veins where a noise field crosses its middle."""
    clouds = _fourier_noise(rng, 1.8, (1.0, 1.0))
    field = _fourier_noise(rng, 2.0, (1.0, 1.6))
    veins = np.exp(-(((field - 0.5) / 0.02) ** 2))
    return _mix(record.rgb, record.rgb2, np.clip(0.22 * clouds + 0.65 * veins, 0, 1))


def _granite(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Speckles of two sizes."""
    coarse = _fourier_noise(rng, 0.8, (1.0, 1.0))
    fine = rng.random((TEXTURE_SIZE, TEXTURE_SIZE))
    return _mix(record.rgb, record.rgb2, np.clip(0.9 * (coarse > 0.62) * 0.6 + 0.35 * (fine > 0.8), 0, 1))


def _tile(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Four by four square tiles with joints, each tile a little lighter or darker."""
    count, joint = 4, 3
    step = TEXTURE_SIZE // count
    row, column = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE]
    in_joint = ((row % step) < joint) | ((column % step) < joint)
    shade = 1.0 + rng.uniform(-0.05, 0.05, (count, count))[row // step, column // step]
    clouds = 0.97 + 0.06 * _fourier_noise(rng, 1.6, (1.0, 1.0))
    tiles = np.asarray(record.rgb) * (shade * clouds)[..., None]
    return np.where(in_joint[..., None], np.asarray(record.rgb2), tiles)


def _subway(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Bricks of 2:1 in a running bond, as on a splashback."""
    rows, joint = 8, 3
    height, width = TEXTURE_SIZE // rows, TEXTURE_SIZE // 4
    row, column = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE]
    shifted = (column + (row // height % 2) * (width // 2)) % TEXTURE_SIZE
    in_joint = ((row % height) < joint) | ((shifted % width) < joint)
    shade = 1.0 + rng.uniform(-0.04, 0.04, (rows, 4))[row // height, shifted // width]
    return np.where(in_joint[..., None], np.asarray(record.rgb2), np.asarray(record.rgb) * shade[..., None])


def _grid() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    row, column = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE]
    return row, column


def _laid(
    record: TextureRecord,
    rng: np.random.Generator,
    piece: NDArray[np.int64],
    in_joint: NDArray[np.bool_],
    spread: float,
    clouds: float = 0.06,
) -> NDArray[np.float64]:
    """Pieces of the main colour, each lighter or darker by up to `spread`, between joints of the second."""
    shade = 1.0 + rng.uniform(-spread, spread, int(piece.max()) + 1)[piece]
    cloud = 1.0 - clouds / 2 + clouds * _fourier_noise(rng, 1.6, (1.0, 1.0))
    return np.where(in_joint[..., None], np.asarray(record.rgb2), np.asarray(record.rgb) * (shade * cloud)[..., None])


def _stacked(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Narrow tiles on end, one above the other."""
    rows, columns, joint = 2, 8, 3
    row, column = _grid()
    height, width = TEXTURE_SIZE // rows, TEXTURE_SIZE // columns
    piece = row // height * columns + column // width
    return _laid(record, rng, piece, ((row % height) < joint) | ((column % width) < joint), 0.06)


def _zellige(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Hand-made square tiles of very uneven glaze."""
    count, joint = 6, 2
    row, column = _grid()
    x, y = column * count // TEXTURE_SIZE, row * count // TEXTURE_SIZE
    edge = TEXTURE_SIZE / count
    in_joint = ((row % edge) < joint) | ((column % edge) < joint)
    return _laid(record, rng, y * count + x, in_joint, 0.16, 0.14)


def _mosaic(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Small square stones between the two colours."""
    count, joint = 16, 2
    row, column = _grid()
    edge = TEXTURE_SIZE // count
    mix = rng.random((count, count))[row // edge, column // edge]
    in_joint = ((row % edge) < joint) | ((column % edge) < joint)
    return np.where(in_joint[..., None], 0.82, _mix(record.rgb, record.rgb2, mix))


def _hexagon(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Honeycomb of hexagonal tiles: each point belongs to the nearest of a lattice of centres."""
    columns, rows = 4, 4
    row, column = _grid()
    x, y = column / TEXTURE_SIZE * columns, row / TEXTURE_SIZE * rows
    nearest = np.full(x.shape, np.inf)
    second = np.full(x.shape, np.inf)
    piece = np.zeros(x.shape, dtype=np.int64)
    for j in range(-1, rows + 1):
        for i in range(-1, columns + 1):
            distance = np.hypot(x - i - 0.5 * (j % 2) - 0.25, (y - j - 0.5) * 0.9)
            closer = distance < nearest
            second = np.where(closer, nearest, np.minimum(second, distance))
            piece = np.where(closer, (j % rows) * columns + i % columns, piece)
            nearest = np.where(closer, distance, nearest)
    return _laid(record, rng, piece, second - nearest < 0.04, 0.05)


def _checker(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Two by two squares of the two colours, with soft clouds, as floor tiles are laid."""
    row, column = _grid()
    half = TEXTURE_SIZE // 2
    clouds = 0.94 + 0.12 * _fourier_noise(rng, 1.6, (1.0, 1.0))
    odd = ((row // half + column // half) % 2).astype(np.float64)
    tiles = _mix(record.rgb, record.rgb2, odd) * clouds[..., None]
    in_joint = ((row % half) < 2) | ((column % half) < 2)
    return np.where(in_joint[..., None], 0.62, tiles)


def _brick(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Rough bricks in a running bond with wide joints."""
    rows, columns, joint = 8, 4, 5
    row, column = _grid()
    height, width = TEXTURE_SIZE // rows, TEXTURE_SIZE // columns
    shifted = (column + (row // height % 2) * (width // 2)) % TEXTURE_SIZE
    wobble = (4 * _fourier_noise(rng, 1.2, (1.0, 1.0)) - 2).astype(np.int64)
    in_joint = ((row % height) < joint + wobble) | ((shifted % width) < joint + wobble)
    return _laid(record, rng, row // height * columns + shifted // width, in_joint, 0.18, 0.25)


def _slabs(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Large stone tiles, two by one, in a running bond."""
    row, column = _grid()
    height, width, joint = TEXTURE_SIZE // 2, TEXTURE_SIZE // 2, 2
    shifted = (column + (row // height % 2) * (width // 2)) % TEXTURE_SIZE
    in_joint = ((row % height) < joint) | ((shifted % width) < joint)
    stone = _stone(record, rng)
    shade = 1.0 + rng.uniform(-0.04, 0.04, (2, 2))[row // height, shifted // width]
    return np.where(in_joint[..., None], np.asarray(record.rgb2) * 0.8, stone * shade[..., None])


def _herringbone(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Blocks of 1:4 at right angles to each other, the pattern turned so that its zigzags run upwards.

    On the lattice of block widths, a cell (x, y) belongs to a lying block where (x - y) mod 8 < 4, else to a standing
    one.
    """
    cells = 16
    edge = TEXTURE_SIZE // cells
    row, column = _grid()
    y, x = row // edge, column // edge
    turn = (x - y) % 8
    lying = turn < 4
    start_x, start_y = np.where(lying, x - turn, x), np.where(lying, y, y - (7 - turn))
    piece = (start_y % cells) * cells + start_x % cells
    inside_x, inside_y = column - start_x * edge, row - start_y * edge
    joint = 2
    in_joint = (inside_x % (4 * edge) < joint) & lying | (inside_y % (4 * edge) < joint) & ~lying
    in_joint |= (row % edge < joint) & lying | (column % edge < joint) & ~lying
    grain = np.where(lying, _fourier_noise(rng, 1.2, (1.0, 10.0)), _fourier_noise(rng, 1.2, (10.0, 1.0)))
    shade = 1.0 + rng.uniform(-0.12, 0.12, cells * cells)[piece]
    wood = _mix(record.rgb, record.rgb2, 0.5 * grain) * shade[..., None]
    return np.where(in_joint[..., None], np.asarray(record.rgb2) * 0.65, wood)


def _butcher(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Glued strips of wood along the horizontal axis."""
    strips = 8
    row, column = _grid()
    strip = row // (TEXTURE_SIZE // strips)
    ends = (column + rng.integers(0, TEXTURE_SIZE, strips)[strip]) % TEXTURE_SIZE
    block = strip * 2 + (ends < TEXTURE_SIZE // 2)
    shade = 1.0 + rng.uniform(-0.10, 0.10, 2 * strips)[block]
    grain = _fourier_noise(rng, 1.2, (1.0, 12.0))
    return _mix(record.rgb, record.rgb2, 0.55 * grain) * shade[..., None]


def _terrazzo(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Chips of several shades in a ground of the main colour."""
    ground = np.asarray(record.rgb) * (0.97 + 0.06 * rng.random((TEXTURE_SIZE, TEXTURE_SIZE, 1)))
    for share, tone in ((0.93, 1.0), (0.93, 0.75), (0.95, 1.2)):
        chips = _fourier_noise(rng, 1.15, (1.0, 1.0)) > share
        ground = np.where(chips[..., None], np.asarray(record.rgb2) * tone, ground)
    return ground


def _concrete(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Cloudy, with pores."""
    cloud = _fourier_noise(rng, 1.5, (1.0, 1.0))
    pores = rng.random((TEXTURE_SIZE, TEXTURE_SIZE)) > 0.985
    return _mix(record.rgb, record.rgb2, np.clip(0.7 * cloud + 0.3 * pores, 0, 1))


def _cloth(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """A plain weave of threads of uneven thickness."""
    row, column = _grid()
    weave = 0.5 + 0.25 * (np.sin(2 * np.pi * row / 8) + np.sin(2 * np.pi * column / 8))
    slub = _fourier_noise(rng, 0.8, (1.0, 8.0)) + _fourier_noise(rng, 0.8, (8.0, 1.0))
    return _mix(record.rgb, record.rgb2, np.clip(0.5 * weave + 0.25 * slub, 0, 1))


def _view(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """The view out of a window: sky of the main colour, clouds, hills and trees over ground of the second."""
    up = np.linspace(1.0, 0.0, TEXTURE_SIZE)[:, None]
    across = np.linspace(0.0, 1.0, TEXTURE_SIZE)[None, :]
    sky = _mix((0.93, 0.95, 0.97), record.rgb, np.broadcast_to(np.clip(1.6 * up - 0.5, 0, 1), (TEXTURE_SIZE,) * 2))
    clouds = np.clip(2.2 * _fourier_noise(rng, 1.7, (2.0, 1.0)) - 1.2, 0, 1)[..., None] * 0.7
    picture = sky * (1 - clouds) + clouds
    for base, swing, waves, tone in ((0.46, 0.05, 2, 0.55), (0.36, 0.07, 3, 0.8)):
        ridge = base + swing * np.sin(2 * np.pi * (waves * across + rng.random()))
        haze = np.asarray(record.rgb2) * tone + (1 - tone) * np.array([0.72, 0.80, 0.86])
        picture = np.where((up < ridge)[..., None], haze, picture)
    leaves = _fourier_noise(rng, 1.1, (1.0, 1.0))
    for _ in range(4):
        x, top, wide = rng.uniform(0.05, 0.95), rng.uniform(0.42, 0.72), rng.uniform(0.08, 0.16)
        crown = ((across - x) / wide) ** 2 + ((up - top + wide) / (1.3 * wide)) ** 2 < 0.7 + 0.5 * leaves
        trunk = (np.abs(across - x) < 0.012) & (up < top - wide) & (up > 0.2)
        picture = np.where(trunk[..., None], np.array([0.30, 0.22, 0.16]), picture)
        green = np.asarray(record.rgb2) * (0.55 + 0.6 * leaves[..., None])
        picture = np.where(crown[..., None], green, picture)
    lawn = np.asarray(record.rgb2) * (0.9 + 0.35 * _fourier_noise(rng, 1.0, (3.0, 1.0))[..., None])
    edge = np.clip((0.24 - up) / 0.02, 0, 1)[..., None]
    return np.asarray(picture * (1 - edge) + lawn * edge)


def _planks(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Floor boards along the vertical axis, each with its own shade and grain."""
    boards = 4
    width = TEXTURE_SIZE // boards
    row, column = np.mgrid[0:TEXTURE_SIZE, 0:TEXTURE_SIZE]
    board = column // width
    ends = (row + rng.integers(0, TEXTURE_SIZE, boards)[board]) % TEXTURE_SIZE
    in_joint = ((column % width) < 2) | (ends < 2)
    shade = 1.0 + rng.uniform(-0.12, 0.12, boards)[board]
    grain = _fourier_noise(rng, 1.2, (10.0, 1.0))
    wood = _mix(record.rgb, record.rgb2, 0.5 * grain) * shade[..., None]
    return np.where(in_joint[..., None], np.asarray(record.rgb2) * 0.6, wood)


def _plaster(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    return _mix(record.rgb, record.rgb2, 0.25 * _fourier_noise(rng, 1.1, (1.0, 1.0)))


def _metal(record: TextureRecord, rng: np.random.Generator) -> NDArray[np.float64]:
    """Brushed along the horizontal axis."""
    return _mix(record.rgb, record.rgb2, 0.5 * _fourier_noise(rng, 0.7, (1.0, 25.0)))


GENERATORS = {
    "wood": _wood,
    "stone": _stone,
    "granite": _granite,
    "terrazzo": _terrazzo,
    "concrete": _concrete,
    "butcher": _butcher,
    "tile": _tile,
    "subway": _subway,
    "stacked": _stacked,
    "zellige": _zellige,
    "mosaic": _mosaic,
    "hexagon": _hexagon,
    "checker": _checker,
    "brick": _brick,
    "slabs": _slabs,
    "planks": _planks,
    "herringbone": _herringbone,
    "plaster": _plaster,
    "metal": _metal,
    "cloth": _cloth,
    "view": _view,
}


@functools.lru_cache(maxsize=512)
def texture_png(record: TextureRecord) -> bytes:
    """PNG bytes of a texture, RGB, 256x256 pixels, tileable; drawn once on a machine (`envs.kept_files`).

    Raises:
        UnknownNameError: the record's kind has no generator.
    """
    if record.kind not in GENERATORS:
        raise UnknownNameError("texture kind", record.kind, GENERATORS)
    return kept("textures", Path(record.file).stem, record, stamp(Path(__file__)), lambda: draw(record))


def draw(record: TextureRecord) -> bytes:
    """As `texture_png`, drawn anew."""
    pixels = GENERATORS[record.kind](record, np.random.default_rng(record.seed))
    buffer = io.BytesIO()
    Image.fromarray(np.round(np.clip(pixels, 0.0, 1.0) * 255).astype(np.uint8)).save(
        buffer, format="PNG", compress_level=1
    )
    return buffer.getvalue()
