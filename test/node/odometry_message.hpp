// A nav_msgs/Odometry in which every value is another.
#pragma once

#include <nav_msgs/Odometry.h>

#include <Eigen/Geometry>

namespace rbpf_node {

inline nav_msgs::Odometry odometryMessage() {
  nav_msgs::Odometry message;
  message.header.stamp = ros::Time(100, 250000000);
  message.header.frame_id = "odom";
  message.child_frame_id = "base_link";
  const Eigen::Quaterniond q(Eigen::AngleAxisd(2.5, Eigen::Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(-0.3, Eigen::Vector3d::UnitY()) *
                             Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX()));
  message.pose.pose.orientation.x = q.x();
  message.pose.pose.orientation.y = q.y();
  message.pose.pose.orientation.z = q.z();
  message.pose.pose.orientation.w = q.w();
  message.pose.pose.position.x = 10.0;
  message.pose.pose.position.y = -20.0;
  message.pose.pose.position.z = -30.0;
  message.twist.twist.linear.x = 1.0;
  message.twist.twist.linear.y = 2.0;
  message.twist.twist.linear.z = 3.0;
  message.twist.twist.angular.x = 0.1;
  message.twist.twist.angular.y = 0.2;
  message.twist.twist.angular.z = 0.3;
  return message;
}

}  // namespace rbpf_node
