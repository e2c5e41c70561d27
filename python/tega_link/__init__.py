"""Connect two stations over Zenoh: the operator and the robot, on machines of their own.

Each station runs the same session as one machine does; :mod:`tega_link.robot` and :mod:`tega_link.operator` put the
link where the other station's devices would be. What passes, and why so, stands in docs/two-machines.md.
"""
