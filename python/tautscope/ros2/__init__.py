"""A node of ROS 2 without a ROS installation: messages of rmw_zenoh, over Zenoh."""
