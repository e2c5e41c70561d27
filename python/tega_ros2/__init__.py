"""Connect to ROS 2: write recordings as bags, publish a run by DDS, and take commands under the run's limits."""
