"""A run as it happens, in one MCAP file with ROS 2 messages; and back: recover, export, replay."""
