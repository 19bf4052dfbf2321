"""Random mechanisms of one to three flexible bars of at most 60 coordinates: what seeds of sweep_mechanisms.py mean.

A chain: the ground or nothing, bars (held by either end, bent or straight, of plastic to steel), rigid cubes between
them, and what holds the end. `drawn(seed)` says what it is, `mechanism_builder.built` builds it. Forces are scaled so
that bars move by 0.5 to 50 % of their length, and bend by 1 % of it at most, as linear elasticity has it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

JOINTS = ("hinge", "spherical", "cardan", "weld", "bushing")
BASES = ("hinge", "spherical", "bushing", "weld", "driven", "none")
ENDS = ("none", "cube", "springs", "rope", "guide")
LOADS = ("at once", "smooth", "late", "late suddenly", "pulse", "off")
GRAVITIES = ("none", "at once", "ramp", "late suddenly", "off")
DAMPINGS = ((0.0, 0.0), (2.0, 1e-5), (0.0, 1e-5), (5.0, 0.0), (0.0, 2e-4))  # alpha in 1/s, beta in s
RATIOS = 1e-3, 0.3  # of modes
MATERIALS = ((2e9, 2000.0, 0.3), (1e10, 1200.0, 0.35), (7e10, 2700.0, 0.33), (2.1e11, 7850.0, 0.3))
MOVES = 5e-3, 0.5  # of a bar's length, or in rad: what a load alone would move it by until the end
BENDS = 1e-2  # of a bar's length: what a load may bend it by, as a clamped beam; also in rad


@dataclass(frozen=True)
class Shape:
    """Factor of a load over time: its kind, angular frequency in rad/s, beginning and duration in s."""

    kind: str
    omega: float
    begin: float
    duration: float

    def at(self, t: float) -> float:
        """Return the factor at time t; kinds are those of LOADS, and "ramp"."""
        late = t - self.begin
        if self.kind == "at once":
            return float(np.cos(self.omega * t))
        if self.kind == "smooth":
            return float(np.sin(self.omega * t) ** 2)
        if self.kind == "late":
            return float(np.sin(self.omega * max(late, 0.0)) ** 2)
        if self.kind == "late suddenly":
            return float(np.cos(self.omega * late)) if late >= 0 else 0.0
        if self.kind == "pulse":
            return float(np.sin(np.pi * late / self.duration) ** 2) if 0 < late < self.duration else 0.0
        if self.kind == "off":
            return 1.0 if late < 0 else 0.0
        return float(np.sin(np.pi / 2 * min(t / self.duration, 1.0)) ** 2)


@dataclass(frozen=True)
class Bar:
    """A flexible bar: fem (see models.hex_bar), modes, damping; turned against the one before, perhaps reversed.

    ratios : of the lowest modes, a float: of all; None: damping is Rayleigh's.
    """

    elements: int
    size: tuple[float, float, float]
    material: tuple[float, float, float]
    shifts: np.ndarray
    kind: str
    n: int
    damping: tuple[float, float]
    kink: np.ndarray
    reversed: bool
    ratios: tuple[float, ...] | float | None = None

    @property
    def damped_by(self) -> str:
        """What its damping is called."""
        return "ratios" if self.ratios is not None else "Rayleigh" if any(self.damping) else "none"

    @property
    def mass(self) -> float:
        """Mass in kg."""
        return self.material[1] * float(np.prod(self.size))


@dataclass(frozen=True)
class Link:
    """What joins two parts at a point: its kind, the axes of the joint (3, 3), stiffness in N/m, length in m."""

    kind: str
    axes: np.ndarray
    stiffness: float
    length: float
    damped: bool


@dataclass(frozen=True)
class Load:
    """A force in N or torque in Nm in global axes on the left or right end of a bar, times a Shape."""

    kind: str
    bar: int
    side: str
    vector: np.ndarray
    shape: Shape


@dataclass(frozen=True)
class Mechanism:
    """Everything a mechanism is made of. links[k]: before bar k, two of them where there is a cube between."""

    seed: int
    bars: tuple[Bar, ...]
    base: str
    links: tuple[tuple[Link, ...], ...]
    end: str
    last: Link
    loads: tuple[Load, ...]
    gravity: tuple[np.ndarray, Shape]
    h: float
    steps: int
    rho: float
    vectors: int | str

    @property
    def classes(self) -> dict[str, list[str]]:
        """Names of classes by which results are counted; a mechanism may be in several of one sort."""
        return {
            "bodies": [str(len(self.bars))],
            "modes": sorted({f"{bar.kind}, n = {bar.n}" for bar in self.bars}),
            "held by": [self.base],
            "joints": sorted({link.kind for links in self.links[1:] for link in links}) or ["none"],
            "end": [self.end],
            "loads": sorted({load.shape.kind for load in self.loads}),
            "gravity": [self.gravity[1].kind],
            "damping": sorted({bar.damped_by for bar in self.bars}),
            "spectral radius": [f"{self.rho:g}"],
        }


def drawn(seed: int) -> Mechanism:
    """Draw a mechanism, a pure function of the seed."""
    rng = np.random.default_rng([seed, 23])
    h, steps = float(rng.choice([2.5e-4, 5e-4, 1e-3])), int(rng.integers(60, 121))
    bars = _bars(rng, int(rng.choice([1, 2, 3], p=[0.35, 0.45, 0.2])))
    base, end = str(rng.choice(BASES)), str(rng.choice(ENDS))
    if len(bars) == 1 and base in ("weld", "driven") and end == "none":
        end = "cube"  # else the frame's motion is known, and the scope another one: benchmarks/sweep.py
    links = [(_link(rng, bars[0], base),)]
    links += [tuple(_link(rng, bar) for _ in range(rng.choice([1, 2]))) for bar in bars[1:]]
    loads = tuple(_load(rng, bars, h * steps, h) for _ in range(rng.choice([1, 2])))
    gravity = 9.81 * _direction(rng), _shape(rng, GRAVITIES, h * steps, h, constant=True)
    last, rho = _link(rng, bars[-1]), float(rng.choice([0.6, 0.8, 0.9, 1.0]))
    vectors = [6, 12, "auto"][rng.choice(3, p=[0.2, 0.3, 0.5])]
    return Mechanism(seed, bars, base, tuple(links), end, last, loads, gravity, h, steps, rho, vectors)


def with_ratios(mechanism: Mechanism) -> Mechanism:
    """Return it with ratios of the modes of every bar in place of its damping."""
    rng, bars = np.random.default_rng([mechanism.seed, 31]), []
    for bar in mechanism.bars:
        ratios = np.exp(rng.uniform(*np.log(RATIOS), int(rng.integers(1, 13))))
        of_all = bool(rng.random() < 0.3)
        bars.append(replace(bar, damping=(0.0, 0.0), ratios=float(ratios[0]) if of_all else tuple(ratios.tolist())))
    return replace(mechanism, bars=tuple(bars))


def _bars(rng: np.random.Generator, count: int) -> tuple[Bar, ...]:
    kind, material = str(rng.choice(["RBE2", "RBE3"])), MATERIALS[rng.integers(len(MATERIALS))]
    damping = DAMPINGS[rng.integers(len(DAMPINGS))]
    bars = []
    for _ in range(count):
        elements, length = int(rng.integers(2, 5)), float(rng.uniform(0.2, 0.6))
        size = (length, *(length * rng.uniform(0.05, 0.15, 2)))
        shifts = np.zeros((elements + 1, 3))
        if rng.random() < 0.5:
            shifts[1:, 1:] = rng.uniform(-0.05, 0.05, (elements, 2)) * length
        n, kink = int(rng.choice([0, 1, 2, 4, 8])), rng.uniform(-0.6, 0.6, 3) * (rng.random() < 0.6)
        bars.append(Bar(elements, size, material, shifts, kind, n, damping, kink, bool(rng.random() < 0.3)))
    return tuple(bars)


def _link(rng: np.random.Generator, bar: Bar, kind: str | None = None) -> Link:
    """Stiffnesses of 0.1 to 10 times that of the clamped bar's tip."""
    kind = kind or str(rng.choice(JOINTS, p=[0.35, 0.3, 0.1, 0.1, 0.15]))
    axes = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    axes[:, 2] *= np.linalg.det(axes)
    stiffness = 10 ** rng.uniform(-1, 1) * 3 * _bending(bar) / bar.size[0] ** 3
    return Link(kind, axes, float(stiffness), float(rng.uniform(0.02, 0.1)), bool(rng.random() < 0.3))


def _load(rng: np.random.Generator, bars: tuple[Bar, ...], T: float, h: float) -> Load:
    number = int(rng.integers(len(bars)))
    bar, kind, mass = bars[number], str(rng.choice(["force", "torque"], p=[0.7, 0.3])), sum(bar.mass for bar in bars)
    length, width = bar.size[0], float(np.hypot(*bar.size[1:]))
    rate = 2 / T**2 * float(np.exp(rng.uniform(*np.log(MOVES))))
    if kind == "force":
        size = min(mass * rate * length, BENDS * 3 * _bending(bar) / length**2)
    else:
        size = min(bar.mass * width**2 / 6 * rate, BENDS * _bending(bar) / length)
    vector = size * _direction(rng)
    return Load(kind, number, str(rng.choice(["left", "right"])), vector, _shape(rng, LOADS, T, h))


def _shape(rng: np.random.Generator, kinds: tuple[str, ...], T: float, h: float, constant: bool = False) -> Shape:
    kind = str(rng.choice(kinds))
    begin = rng.uniform(0.05, 0.85) if kind in ("pulse", "off") else rng.uniform(0.4, 0.8)
    duration = rng.uniform(3, 10) * h if kind == "pulse" else 0.3 * T
    omega = 0.0 if constant else rng.uniform(3, 30) / T
    return Shape(kind, float(omega), float(begin * T), float(duration))


def _direction(rng: np.random.Generator) -> np.ndarray:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _bending(bar: Bar) -> float:
    """E I of the softer direction in N m^2."""
    width, height = sorted(bar.size[1:])
    return bar.material[0] * height * width**3 / 12


def damped(mechanism, is_damped):
    """With a damper at least, or without any beside those of the bars."""
    if is_damped:
        links = tuple(tuple(replace(link, damped=True) for link in of) for of in mechanism.links)
        kinds = [link.kind for of in links for link in of]
        has_one = "hinge" in kinds or "bushing" in kinds or mechanism.end in ("springs", "rope")
        return replace(mechanism, links=links, end=mechanism.end if has_one else "springs")
    links = tuple(
        tuple(replace(link, damped=False, kind="spherical" if link.kind == "bushing" else link.kind) for link in of)
        for of in mechanism.links
    )
    return replace(mechanism, links=links, end="guide" if mechanism.end in ("springs", "rope") else mechanism.end)


def started(mechanism, is_sudden):
    """With a load that is there at once, or without any."""
    first, *others = mechanism.loads
    if is_sudden:
        return replace(mechanism, loads=(replace(first, shape=replace(first.shape, kind="at once")), *others))
    loads = tuple(
        replace(load, shape=replace(load.shape, kind="smooth")) if load.shape.kind in ("at once", "off") else load
        for load in mechanism.loads
    )
    vector, shape = mechanism.gravity
    shape = replace(shape, kind="ramp") if shape.kind in ("at once", "off") else shape
    return replace(mechanism, loads=loads, gravity=(vector, shape))
