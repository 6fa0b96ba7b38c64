"""What people see of impacts: pages, videos, figures and tables. ROS-free."""
