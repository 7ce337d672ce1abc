"""Quantities along a rod: profiles between knots, and the stiffnesses of a section.

The formulas are those of docs/formats.md, written again, so that nothing of leafdyn is needed.
"""
import numpy as np

# The sides of every shape; those of a circle are one.
SIDES = {"circle": ["diameter"], "ellipse": ["width", "thickness"], "rectangle": ["width", "thickness"]}


class Profile:
    """Linear between values at knots."""

    def __init__(self, at, value):
        self.at, self.value = np.array(at, dtype=float), np.array(value, dtype=float)

    def __call__(self, sigma):
        return np.interp(sigma, self.at, self.value)


class Stiffness:
    """One of A1, A2, A3, H1, H2, H3 (from 0) of a section whose sides, modulus and ratio are profiles."""

    def __init__(self, component, shape, sides, young, poisson):
        self.component, self.shape = component, shape
        self.sides, self.young, self.poisson = sides, young, poisson
        self.at = np.unique(np.concatenate([part.at for part in (*sides, young, poisson)]))

    def __call__(self, sigma):
        width, thickness = self.sides[0](sigma), self.sides[-1](sigma)
        young, poisson = self.young(sigma), self.poisson(sigma)
        shear = young / (2.0 * (1.0 + poisson))
        area, torsion, bending = moments(self.shape, width, thickness)
        if self.component == 0:
            return shear * torsion
        if self.component < 3:
            return young * bending[self.component - 1]
        if self.component == 3:
            return young * area
        # Shear along d2 is along the width.
        along, across = (width, thickness) if self.component == 4 else (thickness, width)
        return cowper(self.shape, along, across, poisson) * shear * area


def moments(shape, width, thickness):
    """Area, torsion constant, and second moments of area about d2 and d3."""
    if shape == "rectangle":
        bending = width * thickness**3 / 12.0, width**3 * thickness / 12.0
        return width * thickness, rectangle_torsion(width, thickness), bending
    area = np.pi * width * thickness / 4.0
    torsion = np.pi * width**3 * thickness**3 / (16.0 * (width**2 + thickness**2))
    return area, torsion, (area * thickness**2 / 16.0, area * width**2 / 16.0)


def rectangle_torsion(width, thickness):
    long, short = np.maximum(width, thickness), np.minimum(width, thickness)
    odd = np.arange(1, 60, 2).reshape(-1, *[1] * np.ndim(long))
    terms = np.tanh(odd * np.pi * long / (2.0 * short)) / odd**5
    return long * short**3 * (1.0 / 3.0 - 64.0 / np.pi**5 * short / long * terms.sum(axis=0))


def cowper(shape, along, across, poisson):
    """Cowper's shear factor for a force along the first side."""
    if shape == "rectangle":
        return 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
    a, b = along**2, across**2
    below = (40.0 + 37.0 * poisson) * a**2 + (16.0 + 10.0 * poisson) * a * b + poisson * b**2
    return 12.0 * (1.0 + poisson) * a * (3.0 * a + b) / below
