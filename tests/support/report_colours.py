"""The report's colours, read from its style sheet: contrast as WCAG 2.2 has it, and how the colour-blind see them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import robocasa_lerobot

STYLE = Path(robocasa_lerobot.__file__).parent / "evaluation/report/templates/style.css"
THEMES = ("light", "dark", "system dark")
# G. M. Machado et al., "A physiologically-based model for simulation of color vision deficiency", IEEE TVCG 15 (2009),
# severity 1: linear RGB to linear RGB.
BLINDNESS = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}


def themes() -> dict[str, dict[str, str]]:
    """The custom properties of each theme."""
    css = STYLE.read_text(encoding="utf-8")
    blocks = {
        "light": re.search(r"^:root \{(.*?)\}", css, re.DOTALL | re.MULTILINE),
        "dark": re.search(r':root\[data-theme="dark"\] \{(.*?)\}', css, re.DOTALL),
        "system dark": re.search(r':root:not\(\[data-theme="light"\]\) \{(.*?)\}', css, re.DOTALL),
    }
    out = {}
    for name, found in blocks.items():
        assert found, name
        out[name] = dict(re.findall(r"--([\w-]+): ([^;]+);", found[1]))
    return out


def linear(colour: str) -> NDArray[np.float64]:
    """Linear RGB of `#rrggbb` or `r g b`."""
    parts = [int(colour[i : i + 2], 16) for i in (1, 3, 5)] if colour.startswith("#") else [*map(int, colour.split())]
    rgb = np.array(parts) / 255
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def contrast(a: str, b: str) -> float:
    """WCAG 2.2 contrast ratio of two colours."""
    light, dark = sorted((float(linear(c) @ [0.2126, 0.7152, 0.0722]) for c in (a, b)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def difference(a: str, b: str, blindness: str | None = None) -> float:
    """CIE 1976 colour difference, as seen with full colour vision or without."""
    return float(np.linalg.norm(_lab(a, blindness) - _lab(b, blindness)))


def _lab(colour: str, blindness: str | None) -> NDArray[np.float64]:
    rgb = linear(colour)
    if blindness is not None:
        rgb = np.clip(np.array(BLINDNESS[blindness]) @ rgb, 0, 1)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ rgb
    xyz /= [0.95047, 1.0, 1.08883]
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])
