// Everything that the core publishes.
#pragma once

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <ros/node_handle.h>
#include <tf2_ros/transform_broadcaster.h>

#include "rbpf_core/particle_filter.hpp"
#include "rbpf_core/smoothing/past_smoothing.hpp"
#include "rbpf_node/parameters.hpp"
#include "rbpf_svgp_slam/FilterStatus.h"

namespace rbpf_node {

class Publishers {
 public:
  Publishers(ros::NodeHandle private_node, const rbpf_core::ParticleFilter& filter,
             const Parameters& params);

  // With every odometry message: tf map -> odom, unless its pose is given in map; ~pose.
  void publishPose(const ros::Time& stamp, const std::string& odometry_frame);

  // With every ping: ~ping, the good beams placed by the estimate.
  void publishPing(const ros::Time& stamp);

  // At output/publish_rate_hz: ~particles, ~path, ~dead_reckoning_path, ~bathymetry, ~vehicle,
  // ~graph.
  void publishOverview(const ros::Time& stamp, const rbpf_core::smoothing::SmoothedPast& smoothed);

  void publishStatus(const rbpf_svgp_slam::FilterStatus& status);

 private:
  void publishPaths(const std_msgs::Header& header);
  void publishParticles(const std_msgs::Header& header);
  void publishVehicle(const std_msgs::Header& header);
  void publishGraph(const std_msgs::Header& header,
                    const rbpf_core::smoothing::SmoothedPast& smoothed);
  void publishCloud(const ros::Publisher& publisher, const pcl::PointCloud<pcl::PointXYZ>& cloud,
                    const std_msgs::Header& header) const;
  std_msgs::Header mapHeader(const ros::Time& stamp) const;

  const rbpf_core::ParticleFilter& filter_;
  const Parameters params_;
  ros::Publisher pose_, path_, dead_reckoning_path_, particles_, ping_, bathymetry_, vehicle_,
      graph_, status_;
  tf2_ros::TransformBroadcaster tf_;
};

}  // namespace rbpf_node
