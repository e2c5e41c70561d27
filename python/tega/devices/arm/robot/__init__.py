"""Lead a robot's arm in a process of its own, which lets go when no command comes.

::

    run ──target─► leash ──► slew ──► body ──► arm          one process for the run, one for the arm
    run ◄─status── pose, phase, health ◄──────┘

The leash checks commands by session, number and age; the slew limits the speed of the target for any command; the
body is franky's tracker or a simulated spring. :class:`~tega.devices.arm.robot.driver.ProcessArm` is the run's end.
"""
