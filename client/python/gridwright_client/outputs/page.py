"""The page around a picture of the plane: title, legend, and axes in metres."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Colour = tuple[int, int, int]

_PAPER: Colour = (255, 255, 255)
_INK: Colour = (40, 44, 52)
_FAINT: Colour = (120, 126, 136)
START: Colour = (22, 150, 82)
END: Colour = (214, 52, 44)


@dataclass(frozen=True)
class View:
    """Which part of the plane is seen, and how large."""

    min_x_m: float
    max_y_m: float
    pixels_per_m: float
    width_px: int
    height_px: int

    @property
    def text_px(self) -> int:
        """The height of small print, legible when the whole page is on a screen."""
        return max(18, round(max(self.width_px, self.height_px) / 70))

    def pixel(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions in the drawing area, shape (n, 2)."""
        offset = (points_m - (self.min_x_m, self.max_y_m)) * self.pixels_per_m
        return np.asarray(offset * (1.0, -1.0))


def frame_page(image: Image.Image, view: View, title: str, subtitle: str) -> Image.Image:
    """The picture with axes, title and legend around it."""
    unit = view.text_px
    left, top = round(4.6 * unit), round(5.0 * unit)
    size = (left + view.width_px + round(1.8 * unit), top + view.height_px + round(4.4 * unit))
    page = Image.new("RGB", size, _PAPER)
    page.paste(image, (left, top))
    draw = ImageDraw.Draw(page)
    _draw_axes(draw, view, left, top)
    draw.text((left, unit), title, font=ImageFont.load_default(1.5 * unit), fill=_INK)
    draw.text((left, 3.1 * unit), subtitle, font=ImageFont.load_default(unit), fill=_FAINT)
    _draw_legend(draw, left + view.width_px, 3.1 * unit, unit)
    return page


def draw_mark(draw: ImageDraw.ImageDraw, at: tuple[float, float], radius: float, colour: Colour) -> None:
    """A dot with a light rim."""
    draw.circle(at, radius, fill=colour, outline=_PAPER, width=max(2, round(radius / 4)))


def _draw_legend(draw: ImageDraw.ImageDraw, right: float, y: float, unit: int) -> None:
    font = ImageFont.load_default(unit)
    for name, colour in (("end", END), ("start", START)):
        right -= draw.textlength(name, font=font)
        draw.text((right, y), name, font=font, fill=_INK)
        draw_mark(draw, (right - 0.9 * unit, y + 0.55 * unit), 0.45 * unit, colour)
        right -= 2.5 * unit


def _draw_axes(draw: ImageDraw.ImageDraw, view: View, left: int, top: int) -> None:
    unit = view.text_px
    font = ImageFont.load_default(unit)
    right, bottom = left + view.width_px, top + view.height_px
    draw.rectangle((left - 1, top - 1, right, bottom), outline=_FAINT)
    step_m = _tick_step_m(view)
    width_m, height_m = view.width_px / view.pixels_per_m, view.height_px / view.pixels_per_m
    for x_m in _ticks(view.min_x_m, width_m, step_m):
        x = left + (x_m - view.min_x_m) * view.pixels_per_m
        draw.line((x, bottom, x, bottom + 0.4 * unit), fill=_FAINT, width=2)
        draw.text((x, bottom + 0.7 * unit), f"{x_m:g}", font=font, fill=_INK, anchor="mt")
    for y_m in _ticks(view.max_y_m - height_m, height_m, step_m):
        y = top + (view.max_y_m - y_m) * view.pixels_per_m
        draw.line((left - 0.4 * unit, y, left - 1, y), fill=_FAINT, width=2)
        draw.text((left - 0.7 * unit, y), f"{y_m:g}", font=font, fill=_INK, anchor="rm")
    draw.text((left + view.width_px / 2, bottom + 2.4 * unit), "x in m", font=font, fill=_FAINT, anchor="mt")
    draw.text((left - 0.7 * unit, top - 0.6 * unit), "y in m", font=font, fill=_FAINT, anchor="rb")


def _tick_step_m(view: View) -> float:
    """A round number of metres, some six letters apart."""
    wanted_m = 6 * view.text_px / view.pixels_per_m
    decade = 10.0 ** math.floor(math.log10(wanted_m))
    return next(factor * decade for factor in (1, 2, 5, 10, 20) if factor * decade >= wanted_m)


def _ticks(start_m: float, length_m: float, step_m: float) -> list[float]:
    first, last = math.ceil(start_m / step_m), math.floor((start_m + length_m) / step_m)
    return [round(index * step_m, 6) for index in range(first, last + 1)]
