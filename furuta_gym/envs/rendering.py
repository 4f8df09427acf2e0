"""Pictures of the pendulum: a perspective view, and beside it angles, command and reward as a person reads them."""

import math
import time
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..extras import install
from . import kernels as k

if TYPE_CHECKING:
    from .options import Setup

WIDTH, HEIGHT = 720, 480
_VIEW = 480  # pixels of the perspective view; the panel has the rest
_FINE = 2  # drawn so many times larger and then smoothed

_PAPER, _PANEL, _INK, _FAINT, _FLOOR = (247, 246, 242), (255, 255, 255), (38, 42, 50), (170, 172, 178), (232, 230, 223)
_METAL, _METAL_DARK, _ARM, _ROD, _BOB = (150, 156, 166), (108, 114, 124), (60, 66, 78), (214, 90, 49), (168, 58, 26)
_GOOD, _PUSH = (46, 139, 87), (52, 107, 178)

_CAMERA = np.array([2.9, -3.6, 2.35])
_TARGET = np.array([0.0, 0.0, -0.06])
_FLOOR_Z = -1.3


@dataclass(frozen=True)
class Scene:
    """What a picture shows: angles [rad], command [unit], time [s], reward, and the scales they are drawn on."""

    q1: float
    q2: float
    command: float
    time: float
    reward: float
    task: str
    unit: str
    u_max: float
    arm_limit: float
    reward_scale: float
    pendulum_over_arm: float

    @classmethod
    def of(cls, setup: "Setup", column: NDArray[np.float64]) -> "Scene":
        """From one env's column of the compiled block."""
        theta = setup.plant.theta
        # a uniform rod of length 2 l2 on an arm of length L1: 3/2 θ4/θ3, kept where both can be seen
        ratio = float(np.clip(1.5 * theta[3] / abs(theta[2]) if theta[2] else 1.0, 0.8, 1.25))
        q1, q2 = (float(v) for v in column[k.N_FIXED : k.N_FIXED + 2])
        command, time, reward = (float(column[row]) for row in (k.COMMAND, k.TIME, k.REWARD))
        return cls(
            q1, q2, command, time, reward, setup.options.task, setup.plant.unit, setup.plant.u_max,
            setup.arm_limit, setup.options.reward_scale, ratio,
        )  # fmt: skip


class Viewer:
    """Draws scenes with pygame, to an array (which needs no screen) or to a window. trail: keep where the tip was."""

    def __init__(self, trail: bool = False) -> None:
        try:
            import pygame
        except ImportError as error:
            from gymnasium.error import DependencyNotInstalled

            raise DependencyNotInstalled(f"rendering needs pygame: {install('report')}") from error
        self._pygame: Any = pygame
        pygame.font.init()
        self._fonts = {size: pygame.font.Font(None, size * _FINE) for size in (20, 26, 34)}
        self._canvas = pygame.Surface((WIDTH * _FINE, HEIGHT * _FINE))
        self._trail: deque[tuple[float, float]] = deque(maxlen=60 if trail else 0)  # pixels
        self._words: dict[tuple[Any, ...], Any] = {}
        self._ground: Any = pygame.Surface(self._canvas.get_size())  # what no motion changes, painted once
        self._pillar: Any = None
        self._window: Any = None
        self._shown = -math.inf
        self._origin = 0.0  # s on the wall's clock at which the episode began

    def draw(self, scene: Scene) -> NDArray[np.uint8]:
        """Picture of the scene, (height, width, 3)."""
        picture = self._paint(scene)
        data = self._pygame.image.tobytes(picture, "RGB")
        return np.frombuffer(data, np.uint8).reshape(HEIGHT, WIDTH, 3).copy()

    def show(self, scene: Scene) -> None:
        """Show the scene in the window, in real time; at most 60 pictures a second are drawn.

        A program that is too slow is not made up for: the clock goes on from where it came late by 0.1 s.
        """
        pygame = self._pygame
        if scene.time > 0.0 and 0.0 <= scene.time - self._shown < 1.0 / 60.0 - 1e-9:
            return  # the start of an episode is always drawn
        if self._window is None:
            pygame.display.init()
            pygame.display.set_caption("FurutaID-v0")
            self._window = pygame.display.set_mode((WIDTH, HEIGHT))
        picture = self._paint(scene)
        early = self._origin + scene.time - time.perf_counter()
        if scene.time <= self._shown or not -0.1 < early < 1.0:
            self._origin = time.perf_counter() - scene.time
        elif early > 0.0:
            time.sleep(early)
        self._shown = scene.time
        self._window.blit(picture, (0, 0))
        pygame.event.pump()
        pygame.display.flip()

    def close(self) -> None:
        if self._window is not None:
            self._pygame.display.quit()
            self._window = None

    def _paint(self, scene: Scene) -> Any:
        if self._pillar is None:
            self._paint_ground()
        self._canvas.blit(self._ground, (0, 0))
        self._view(scene)
        self._panel(scene)
        return self._pygame.transform.smoothscale(self._canvas, (WIDTH, HEIGHT))

    def _paint_ground(self) -> None:
        """The floor, and the pillar on a layer of its own, as the arm may pass behind it."""
        moving = self._canvas
        self._canvas = self._ground
        self._canvas.fill(_PAPER)
        self._floor()
        self._canvas = self._pygame.Surface(moving.get_size(), self._pygame.SRCALPHA)
        self._stand()
        place = self._canvas.get_bounding_rect()
        self._pillar = self._canvas.subsurface(place).copy(), place.topleft
        self._canvas = moving

    # --- the perspective view

    def _view(self, scene: Scene) -> None:
        arm, rod = 1.0, scene.pendulum_over_arm
        s1, c1, s2, c2 = math.sin(scene.q1), math.cos(scene.q1), math.sin(scene.q2), math.cos(scene.q2)
        along, across = np.array([c1, s1, 0.0]), np.array([-s1, c1, 0.0])
        hub, joint = np.zeros(3), arm * along
        tip = joint + rod * (s2 * across + c2 * np.array([0.0, 0.0, 1.0]))
        if scene.time <= 0.0:
            self._trail.clear()
        self._trail.append(_project(tip))
        self._shadow(joint, tip)
        self._curve(joint + rod * (_CIRCLE[:, :1] * across + _CIRCLE[:, 1:] * _Z), _FAINT, 1, closed=True)
        for i, (x, y) in enumerate(list(self._trail)[:-1]):
            shade = (i + 1) / len(self._trail)
            self._disc(x, y, 1.0 + 1.5 * shade, _mix(_PAPER, _ROD, 0.55 * shade))
        upright = joint + np.array([0.0, 0.0, rod])
        self._curve([upright - 0.05 * across, upright + 0.05 * across], _GOOD, 3)
        # nearer things cover what lies behind them
        parts = [
            (_depth(hub), lambda: self._canvas.blit(*self._pillar)),
            (_depth(0.5 * (hub + joint)), lambda: self._bar(-0.22 * along, joint, 9, _ARM)),
            (_depth(0.5 * (joint + tip)) - 0.01, lambda: self._pendulum(joint, tip, along)),
        ]
        for _, paint in sorted(parts, key=lambda part: -part[0]):
            paint()

    def _floor(self) -> None:
        ring = [np.array([1.35 * math.cos(a), 1.35 * math.sin(a), _FLOOR_Z]) for a in _angles(96)]
        self._polygon(ring, _FLOOR)
        self._curve(ring, _FAINT, 1, closed=True)
        for i, a in enumerate(_angles(24)):
            inner = 1.22 if i % 6 == 0 else 1.29
            direction = np.array([math.cos(a), math.sin(a), 0.0])
            floor = np.array([0.0, 0.0, _FLOOR_Z])
            self._curve([inner * direction + floor, 1.35 * direction + floor], _FAINT, 2 if i % 6 == 0 else 1)

    def _shadow(self, joint: NDArray[np.float64], tip: NDArray[np.float64]) -> None:
        flat = np.array([1.0, 1.0, 0.0])
        down = np.array([0.0, 0.0, _FLOOR_Z])
        shadow = _mix(_FLOOR, _INK, 0.22)
        self._curve([down, flat * joint + down], shadow, 7)
        self._curve([flat * joint + down, flat * tip + down], shadow, 4)

    def _stand(self) -> None:
        for radius, low, high in ((0.34, _FLOOR_Z, _FLOOR_Z + 0.1), (0.17, _FLOOR_Z + 0.1, -0.06)):
            for z, colour in ((low, _METAL_DARK), (high, _METAL)):
                disc = [np.array([radius * math.cos(a), radius * math.sin(a), z]) for a in _angles(40)]
                if z == low:
                    top = [point + np.array([0.0, 0.0, high - low]) for point in disc]
                    self._hull(disc + top, _METAL_DARK)
                else:
                    self._polygon(disc, colour)
        x, y = _project(np.zeros(3))
        self._disc(x, y, 11, _INK)
        self._disc(x, y, 5, _METAL)

    def _pendulum(self, joint: Any, tip: Any, along: Any) -> None:
        self._bar(joint - 0.1 * along, joint + 0.12 * along, 11, _METAL_DARK)
        self._bar(joint + 0.07 * along, tip + 0.07 * along, 7, _ROD)
        x, y = _project(tip + 0.07 * along)
        self._disc(x, y, 11, _BOB)
        self._disc(x - 2.5, y - 2.5, 4, _mix(_BOB, _PAPER, 0.45))

    # --- the panel

    def _panel(self, scene: Scene) -> None:
        pygame, f = self._pygame, _FINE
        pygame.draw.rect(self._canvas, _PANEL, (_VIEW * f, 0, (WIDTH - _VIEW) * f, HEIGHT * f))
        pygame.draw.line(self._canvas, _FLOOR, (_VIEW * f, 0), (_VIEW * f, HEIGHT * f), 2 * f)
        left, middle = _VIEW + 22, (_VIEW + WIDTH) // 2
        self._text(scene.task.replace("_", " "), left, 18, 34)
        self._text(f"{scene.time:.2f} s", WIDTH - 22, 23, 26, anchor="right")
        self._dial(left + 43, 128, scene.q1, "arm q1", "from above", mark=None)
        self._dial(WIDTH - 22 - 43, 128, scene.q2, "pendulum q2", "0 is upright", mark=0.0)
        self._meter(268, "command", f"{scene.command:+.2f} {scene.unit}", scene.command / scene.u_max, _PUSH, True)
        pygame.draw.line(self._canvas, _INK, (middle * f, 290 * f), (middle * f, 312 * f), f)
        self._text(f"-{scene.u_max:g}", left, 316, 20, _FAINT)
        self._text(f"+{scene.u_max:g}", WIDTH - 22, 316, 20, _FAINT, anchor="right")
        turns = f"{scene.q1 / (2 * math.pi):+.2f} turns"
        self._meter(346, "arm travel", turns, scene.q1 / scene.arm_limit, _ARM, True)
        self._meter(408, "reward", f"{scene.reward:.2f}", scene.reward / scene.reward_scale, _GOOD, False)

    def _dial(self, x: int, y: int, angle: float, name: str, hint: str, mark: float | None) -> None:
        """A clock face: the pendulum's zero is up, as on the rig; the arm's is to the right, as seen from above."""
        pygame, f, radius = self._pygame, _FINE, 40
        self._disc(x, y, radius, _PAPER)
        pygame.draw.circle(self._canvas, _FAINT, (x * f, y * f), radius * f, f)
        if mark is None:
            dx, dy = math.cos(angle), -math.sin(angle)
            self._disc(x + 0.86 * radius, y, 2.5, _GOOD)
        else:
            dx, dy = math.sin(angle), -math.cos(angle)
            self._disc(x, y - 0.86 * radius, 2.5, _GOOD)
        colour = _ARM if mark is None else _ROD
        end = ((x + 0.78 * radius * dx) * f, (y + 0.78 * radius * dy) * f)
        self._thick((x * f, y * f), end, 6 * f, colour)
        self._disc(x, y, 5, _INK)
        self._text(name, x, y - 62, 20, anchor="centre")
        turned = math.remainder(angle, 2 * math.pi)
        self._text(f"{math.degrees(turned):+.1f}°", x, y + 50, 26, anchor="centre")
        self._text(hint, x, y + 72, 20, _FAINT, anchor="centre")

    def _meter(self, y: int, name: str, value: str, share: float, colour: Any, both_ways: bool) -> None:
        pygame, f = self._pygame, _FINE
        left, right = _VIEW + 22, WIDTH - 22
        self._text(name, left, y, 20)
        self._text(value, right, y, 20, anchor="right")
        bar = pygame.Rect(left * f, (y + 24) * f, (right - left) * f, 18 * f)
        pygame.draw.rect(self._canvas, _FLOOR, bar, border_radius=4 * f)
        share = min(max(share, -1.0), 1.0)
        start, width = (bar.centerx, bar.width / 2) if both_ways else (bar.left, bar.width)
        filled = pygame.Rect(min(start, start + share * width), bar.top, abs(share) * width, bar.height)
        pygame.draw.rect(self._canvas, colour, filled, border_radius=3 * f)

    # --- primitives, in pixels of the finished picture

    def _text(self, text: str, x: float, y: float, size: int, colour: Any = _INK, anchor: str = "left") -> None:
        picture = self._words.get((text, size, colour))
        if picture is None:
            if len(self._words) > 500:  # numbers that change; the others are soon back
                self._words.clear()
            picture = self._words[text, size, colour] = self._fonts[size].render(text, True, colour)
        shift = {"left": 0.0, "centre": 0.5, "right": 1.0}[anchor] * picture.get_width()
        self._canvas.blit(picture, (x * _FINE - shift, y * _FINE))

    def _disc(self, x: float, y: float, radius: float, colour: Any) -> None:
        self._pygame.draw.circle(self._canvas, colour, (x * _FINE, y * _FINE), radius * _FINE)

    def _curve(self, points: Any, colour: Any, width: float, closed: bool = False) -> None:
        flat = (_FINE * _project_all(np.asarray(points))).tolist()
        if len(flat) == 2:
            self._thick(flat[0], flat[1], width * _FINE, colour)
        else:
            self._pygame.draw.lines(self._canvas, colour, closed, flat, width * _FINE)

    def _polygon(self, points: list[Any], colour: Any) -> None:
        self._pygame.draw.polygon(self._canvas, colour, [tuple(v * _FINE for v in _project(p)) for p in points])

    def _hull(self, points: list[Any], colour: Any) -> None:
        flat = sorted({_project(p) for p in points})
        sides: list[list[tuple[float, float]]] = []
        for ordered in (flat, flat[::-1]):
            side: list[tuple[float, float]] = []
            for p in ordered:
                while len(side) > 1 and _left_turn(side[-2], side[-1], p) <= 0:
                    side.pop()
                side.append(p)
            sides.append(side[:-1])
        self._pygame.draw.polygon(self._canvas, colour, [(x * _FINE, y * _FINE) for x, y in sides[0] + sides[1]])

    def _bar(self, start: Any, end: Any, width: float, colour: Any) -> None:
        """A round rod with a light along it."""
        a, b = ([v * _FINE for v in _project(p)] for p in (start, end))
        self._thick(a, b, width * _FINE, colour)
        light = _mix(colour, _PAPER, 0.35)
        shift = -0.18 * width * _FINE
        self._thick((a[0] + shift, a[1] + shift), (b[0] + shift, b[1] + shift), 0.22 * width * _FINE, light)

    def _thick(self, a: Any, b: Any, width: float, colour: Any) -> None:
        dx, dy = b[0] - a[0], b[1] - a[1]
        length = math.hypot(dx, dy) or 1.0
        nx, ny = -dy / length * width / 2, dx / length * width / 2
        quad = [(a[0] + nx, a[1] + ny), (b[0] + nx, b[1] + ny), (b[0] - nx, b[1] - ny), (a[0] - nx, a[1] - ny)]
        self._pygame.draw.polygon(self._canvas, colour, quad)
        for end in (a, b):
            self._pygame.draw.circle(self._canvas, colour, end, width / 2)


def _angles(n: int) -> list[float]:
    return [2 * math.pi * i / n for i in range(n)]


def _mix(a: tuple[int, ...], b: tuple[int, ...], share: float) -> tuple[int, ...]:
    return tuple(round(x + share * (y - x)) for x, y in zip(a, b, strict=True))


_Z = np.array([0.0, 0.0, 1.0])
_CIRCLE = np.array([(math.sin(a), math.cos(a)) for a in _angles(72)])


def _left_turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


_FORWARD = (_TARGET - _CAMERA) / np.linalg.norm(_TARGET - _CAMERA)
_RIGHT = np.cross(_FORWARD, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(_FORWARD, [0.0, 0.0, 1.0]))
_UP = np.cross(_RIGHT, _FORWARD)
_FOCAL = 1.2 * _VIEW


def _depth(point: NDArray[np.float64]) -> float:
    return float((point - _CAMERA) @ _FORWARD)


def _project(point: NDArray[np.float64]) -> tuple[float, float]:
    """Pixel of a point in space, seen from the camera."""
    d = point - _CAMERA
    scale = _FOCAL / float(d @ _FORWARD)
    return _VIEW / 2 + scale * float(d @ _RIGHT), HEIGHT / 2 - scale * float(d @ _UP)


def _project_all(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (n, 2) of points (n, 3)."""
    d = points - _CAMERA
    scale = _FOCAL / (d @ _FORWARD)
    return np.stack([_VIEW / 2 + scale * (d @ _RIGHT), HEIGHT / 2 - scale * (d @ _UP)], axis=1)
