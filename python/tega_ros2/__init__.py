"""Write recordings as ROS 2 bags."""
