"""What a tracker sees of a person's fingers, which may move nothing.

A person without a hand has a forearm to track (:mod:`tega.arm`) and no fingers; a person with one must not have an
advantage that the other lacks. Nothing that leads to a command may import :mod:`tega.tracking.fingers`.
"""
