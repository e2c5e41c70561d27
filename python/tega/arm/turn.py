"""Run one turn of the arm's steering with all of its inputs, so that a recording gives the same command."""

from __future__ import annotations

from typing import NamedTuple

from tega.arm.chain import ArmChain
from tega.arm.pose import ArmCommand, StampedPose


class Turn(NamedTuple):
    """Inputs of one turn of the loop that steers an arm.

    Attributes:
        t_ns: When, on the clock of the stamps.
        poses: Forearm poses since the last turn, in the tracker's axes.
        may_move: Whether the run lets the arm move.
        measured: New measured pose of the hand, if there is one.
        stopped: Why the arm is to stop now; ``""`` if it is not to.
        cleared: Whether a person has allowed it to go on.
    """

    t_ns: int
    poses: tuple[StampedPose, ...] = ()
    clutch: bool = False
    dead_man: bool = False
    may_move: bool = False
    measured: StampedPose | None = None
    stopped: str = ""
    cleared: bool = False


def lead(chain: ArmChain, turn: Turn) -> ArmCommand:
    """Give a chain the inputs of one turn: all that a run does with the chain is here."""
    if turn.stopped:
        chain.stop(turn.stopped)
    elif turn.cleared:
        chain.clear()
    command = chain.step(
        turn.t_ns,
        turn.poses,
        clutch=turn.clutch,
        dead_man=turn.dead_man and turn.may_move,
        measured=turn.measured,
    )
    if command.state == "holding" and turn.dead_man and not turn.may_move:
        command = command._replace(reason="the run is not active")
    return command
