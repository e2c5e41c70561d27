"""Move the target towards a goal within limits of speed and acceleration, and never out of the workspace.

Place and turn are each a state (x, v). Within a tick of dt seconds the velocity changes at the full acceleration A
from v to a new v' and then stays, which makes the mean velocity m::

    tau = |v' - v| / A <= dt,      m = ((v + v') / 2 · tau + v' · (dt - tau)) / dt
    place: x += m dt               turn: x = exp(m dt) x

v(t) thus never changes faster than A and never exceeds the larger of v and v', whatever dt is. The speed towards
the goal, d away, is the largest s after which braking still ends at the goal (:func:`closing_speed`).

Braking straight on from the new state ends at x + v'|v'| / (2 A). A tick is taken only if that way stays inside;
else less of it; at last the tick brakes, and braking leads to the end that was inside before. So there is always a
way to stop inside, at any rate.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tega.arm.pose import Pose
from tega.arm.rotation import Floats, between, cross, exp, multiply, rotate, same_side, size, unit
from tega.arm.settings import LimitSettings
from tega.arm.workspace import Workspace

_HALVINGS = 6
_GIVE = 1e-9
_AMBIGUOUS_RAD = 2.5


def closing_speed(speed: float, distance: float, acceleration: float, dt_s: float) -> float:
    """Return the largest speed for the end of a tick after which one can still stop within the distance.

    From the way of this tick and of braking after it, with the change of speed at the full acceleration::

        s >= speed:   -speed²/2A + s dt + s speed/A               = distance
        s <  speed:    speed²/2A + s dt - s speed/A + s²/A        = distance

    ``speed`` is towards the goal now, negative if away from it; ``acceleration`` is the limit A, ``dt_s`` the
    length of the tick. The result is 0 or more; infinite if there is not even time to turn round. The caller has
    to limit it to a speed that is reachable within the tick.

    Example:
        >>> closing_speed(1.0, 0.5, 1.0, 0.1)
        0.9
    """
    route = speed * speed / (2 * acceleration)
    room = dt_s + speed / acceleration
    if room <= 0:
        return math.inf
    faster = (distance + route) / room
    if faster >= speed:
        return faster
    if distance < route:
        return 0.0
    over = speed / acceleration - dt_s
    return acceleration / 2 * (over + math.sqrt(over * over + 4 / acceleration * (distance - route)))


class _Tick:
    """One tick of a place or a turn: from a velocity, an error and limits to the next velocity."""

    def __init__(self, speed: float, acceleration: float) -> None:
        self._speed, self._acceleration = speed, acceleration

    def braking_distance(self, velocity: Floats) -> Floats:
        return velocity * (size(velocity) / (2 * self._acceleration))

    def change(self, velocity: Floats, wanted: Floats, dt_s: float) -> tuple[Floats, Floats]:
        """Return the velocity at the end of the tick and its mean over the tick."""
        change = wanted - velocity
        tau = size(change) / self._acceleration
        if tau > dt_s:
            new = velocity + change * (dt_s / tau)
            return new, (velocity + new) / 2
        return wanted, ((velocity + wanted) / 2 * tau + wanted * (dt_s - tau)) / dt_s

    def choose(
        self, velocity: Floats, error: Floats, dt_s: float, stays: Callable[[Floats, Floats], bool]
    ) -> tuple[Floats, Floats]:
        """Go on towards the goal as fast as ``stays(new velocity, way)`` allows, or else brake."""
        distance = size(error)
        wanted = np.zeros(3)
        if distance > 0:
            towards = error / distance
            closing = closing_speed(float(velocity @ towards), distance, self._acceleration, dt_s)
            wanted = towards * min(self._speed, closing)
        new, mean = self.change(velocity, wanted, dt_s)
        if stays(new, mean * dt_s):
            return new, mean
        best = self.change(velocity, np.zeros(3), dt_s)
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            share = (low + high) / 2
            new, mean = self.change(velocity, share * wanted, dt_s)
            if stays(new, mean * dt_s):
                low, best = share, (new, mean)
            else:
                high = share
        return best


class Follower:
    """Moves the target towards a goal, within limits, from ``start``, which must be inside, at rest.

    ``velocity_m_s`` and ``velocity_rad_s``, float64 (3,), are in the base's axes.
    """

    def __init__(self, limits: LimitSettings, workspace: Workspace, start: Pose) -> None:
        self._limits, self._workspace = limits, workspace
        self._place_tick = _Tick(limits.speed_m_s, limits.acceleration_m_s2)
        self._turn_tick = _Tick(limits.turn_rad_s, limits.turn_acceleration_rad_s2)
        self._twist = 0.0
        self.pose = start
        self.velocity_m_s: Floats = np.zeros(3)
        self.velocity_rad_s: Floats = np.zeros(3)

    def resting(self) -> Pose:
        """Return the pose at which the target would come to rest if it braked now."""
        place, q = self.pose
        turn = self._turn_tick.braking_distance(self.velocity_rad_s)
        return Pose(
            place + self._place_tick.braking_distance(self.velocity_m_s),
            unit(multiply(exp(turn), q)) if turn.any() else q,
        )

    def brake(self, dt_s: float) -> None:
        """Come to rest, or nearer to it."""
        self.velocity_m_s, mean = self._place_tick.change(self.velocity_m_s, np.zeros(3), dt_s)
        self.velocity_rad_s, turning = self._turn_tick.change(self.velocity_rad_s, np.zeros(3), dt_s)
        self._go(mean * dt_s, turning * dt_s)

    def step(self, goal: Pose, dt_s: float, measured: Pose | None = None) -> None:
        """Go on towards a goal inside the workspace for ``dt_s``, more than 0.

        If the way to stop lies within the clip around the ``measured`` hand, it stays there; where it does
        not, since the hand was moved, box and cone alone bind the way back.
        """
        place, q = self.pose
        v, w = self.velocity_m_s, self.velocity_rad_s
        error = goal.position_m - place
        turn_error = self._turn_error(q, goal.quaternion_xyzw)

        def in_box(new: Floats, route: Floats) -> bool:
            end = place + route
            stop = end + self._place_tick.braking_distance(new)
            return self._workspace.holds_place(end) and self._workspace.holds_place(stop)

        def in_cone(new: Floats, route: Floats) -> bool:
            return self._workspace.holds_turning(
                unit(multiply(exp(route), q)), self._turn_tick.braking_distance(new)
            )

        near, turned_near = in_box, in_cone
        if measured is not None:
            stop, ahead_m, ahead_rad = self.resting(), self._limits.ahead_m, self._limits.ahead_rad
            if size(stop.position_m - measured.position_m) <= ahead_m + _GIVE:

                def near(new: Floats, route: Floats) -> bool:
                    end = place + route - measured.position_m
                    farthest = max(size(end), size(end + self._place_tick.braking_distance(new)))
                    return farthest <= ahead_m + _GIVE and in_box(new, route)

            if size(between(measured.quaternion_xyzw, stop.quaternion_xyzw)) <= ahead_rad + _GIVE:

                def turned_near(new: Floats, route: Floats) -> bool:
                    end = multiply(exp(route), q)
                    stop = multiply(exp(self._turn_tick.braking_distance(new)), end)
                    farthest = max(size(between(measured.quaternion_xyzw, at)) for at in (end, stop))
                    return farthest <= ahead_rad + _GIVE and in_cone(new, route)

        self.velocity_m_s, mean = self._place_tick.choose(v, error, dt_s, near)
        self.velocity_rad_s, turning = self._turn_tick.choose(w, turn_error, dt_s, turned_near)
        self._go(mean * dt_s, turning * dt_s)

    def _go(self, route: Floats, turn: Floats) -> None:
        place, q = self.pose
        # A turn of nothing leaves the very same numbers: a target at rest does not drift by rounding.
        turned = same_side(unit(multiply(exp(turn), q)), q) if turn.any() else q
        self.pose = Pose(place + route, turned)

    def _turn_error(self, q: Floats, goal: Floats) -> Floats:
        """Return the rotation vector towards a goal as a swing of the tool's axis and a twist about it.

        The swing leads along the great circle, which stays in the cone if both ends do; the way of the plain
        logarithm may leave it. Near half a turn the twist keeps its sense.
        """
        tool = self._workspace.tool_axis
        d, g = rotate(q, tool), rotate(goal, tool)
        across = cross(d, g)
        sine = size(across)
        swing = across * (math.atan2(sine, float(d @ g)) / sine) if sine > 1e-15 else np.zeros(3)
        twist = float(between(multiply(exp(swing), q), goal) @ g)
        if abs(twist) > _AMBIGUOUS_RAD and abs(self._twist) > _AMBIGUOUS_RAD and twist * self._twist < 0:
            twist += math.copysign(2 * math.pi, self._twist)
        self._twist = twist
        error: Floats = swing + twist * d
        return error
