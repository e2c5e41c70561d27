"""Count what a simulated person feels of the forces in lifts."""
