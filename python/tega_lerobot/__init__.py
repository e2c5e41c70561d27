"""Export a recording as a LeRobot dataset, format v3.0, without the package ``lerobot``."""
