#include "rbpf_node/publishers.hpp"

#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Path.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl_conversions/pcl_conversions.h>
#include <tf2_eigen/tf2_eigen.h>
#include <visualization_msgs/MarkerArray.h>

#include "rbpf_node/conversions.hpp"

namespace rbpf_node {

namespace {

// What RViz can draw at the publishing rate without falling behind.
constexpr std::size_t kOverviewPings = 3000;

void append(const rbpf_core::Beams& placed_m, pcl::PointCloud<pcl::PointXYZ>* cloud) {
  for (Eigen::Index i = 0; i < placed_m.cols(); ++i) {
    cloud->push_back({placed_m(0, i), placed_m(1, i), placed_m(2, i)});
  }
}

}  // namespace

Publishers::Publishers(ros::NodeHandle private_node, const rbpf_core::ParticleFilter& filter,
                       const Parameters& params)
    : filter_(filter), params_(params) {
  ros::NodeHandle& node = private_node;
  pose_ = node.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 100);
  path_ = node.advertise<nav_msgs::Path>("path", 1, true);
  dead_reckoning_path_ = node.advertise<nav_msgs::Path>("dead_reckoning_path", 1, true);
  particles_ = node.advertise<geometry_msgs::PoseArray>("particles", 10);
  ping_ = node.advertise<sensor_msgs::PointCloud2>("ping", 100);
  bathymetry_ = node.advertise<sensor_msgs::PointCloud2>("bathymetry", 1, true);
  vehicle_ = node.advertise<visualization_msgs::Marker>("vehicle", 10);
  graph_ = node.advertise<visualization_msgs::MarkerArray>("graph", 1, true);
  status_ = node.advertise<rbpf_svgp_slam::FilterStatus>("status", 10, true);
}

std_msgs::Header Publishers::mapHeader(const ros::Time& stamp) const {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = params_.frames.map;
  return header;
}

void Publishers::publishPose(const ros::Time& stamp, const std::string& odometry_frame) {
  const rbpf_core::Estimate estimate = filter_.snapshot().estimate();

  // T_map_odom = T_map_base T_base_odom: with the odometry's own pose it makes the estimate
  const Eigen::Isometry3d T_map_odom = toIsometry(estimate.mean, estimate.attitude) *
                                       toIsometry(estimate.odometry, estimate.attitude).inverse();
  geometry_msgs::TransformStamped transform = tf2::eigenToTransform(T_map_odom);
  transform.header = mapHeader(stamp);
  transform.child_frame_id = params_.frames.odom;
  if (odometry_frame != params_.frames.map) tf_.sendTransform(transform);

  geometry_msgs::PoseWithCovarianceStamped pose;
  pose.header = transform.header;
  pose.pose.pose = toPose(estimate.mean, estimate.attitude);
  constexpr int kRow[3] = {0, 1, 5};  // x, y, yaw in the message's 6 x 6
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      pose.pose.covariance[static_cast<std::size_t>(6 * kRow[a] + kRow[b])] =
          estimate.covariance(a, b);
    }
  }
  pose_.publish(pose);
}

void Publishers::publishPing(const ros::Time& stamp) {
  if (ping_.getNumSubscribers() == 0) return;
  const rbpf_core::FilterSnapshot snapshot = filter_.snapshot();
  if (snapshot.pings() == 0) return;
  const auto latest = snapshot.survey(snapshot.pings() - 1, 1);
  pcl::PointCloud<pcl::PointXYZ> cloud;
  append(placeBeams(latest[0].levelled_m, latest[0].estimate), &cloud);
  publishCloud(ping_, cloud, mapHeader(stamp));
}

void Publishers::publishOverview(const ros::Time& stamp,
                                 const rbpf_core::smoothing::SmoothedPast& smoothed) {
  const std_msgs::Header header = mapHeader(stamp);
  publishParticles(header);
  publishVehicle(header);
  if (graph_.getNumSubscribers() > 0) publishGraph(header, smoothed);
  if (path_.getNumSubscribers() + dead_reckoning_path_.getNumSubscribers() +
          bathymetry_.getNumSubscribers() >
      0) {
    publishPaths(header);
  }
}

void Publishers::publishParticles(const std_msgs::Header& header) {
  const rbpf_core::FilterSnapshot snapshot = filter_.snapshot();
  const rbpf_core::Attitude attitude = snapshot.estimate().attitude;
  geometry_msgs::PoseArray message;
  message.header = header;
  for (const rbpf_core::Pose2& pose : snapshot.particles()) {
    message.poses.push_back(toPose(pose, attitude));
  }
  particles_.publish(message);
}

void Publishers::publishVehicle(const std_msgs::Header& header) {
  const rbpf_core::Estimate estimate = filter_.snapshot().estimate();
  visualization_msgs::Marker marker;
  marker.header = header;
  marker.ns = "vehicle";
  marker.type = visualization_msgs::Marker::ARROW;
  marker.pose = toPose(estimate.mean, estimate.attitude);
  const double length_m = params_.vehicle_length_m;
  marker.points.resize(2);  // tail and head
  marker.points[0].x = -0.5 * length_m;
  marker.points[1].x = 0.5 * length_m;
  marker.scale.x = 0.15 * length_m;  // diameter of the shaft
  marker.scale.y = 0.3 * length_m;   // diameter of the head
  marker.scale.z = 0.3 * length_m;   // length of the head
  marker.color.r = marker.color.a = 1.0F;
  marker.color.g = 0.75F;
  vehicle_.publish(marker);
}

// The track that the graph has found, and its closures: green ones that fit, red ones that are
// weighted down.
void Publishers::publishGraph(const std_msgs::Header& header,
                              const rbpf_core::smoothing::SmoothedPast& smoothed) {
  const double z_m = filter_.snapshot().estimate().attitude.z_m;
  const auto point = [&](const rbpf_core::Pose2& pose) {
    geometry_msgs::Point at;
    at.x = pose.x_m;
    at.y = pose.y_m;
    at.z = z_m;
    return at;
  };
  visualization_msgs::Marker track;
  track.header = header;
  track.ns = "track";
  track.type = visualization_msgs::Marker::LINE_STRIP;
  track.pose.orientation.w = 1.0;
  track.scale.x = 0.3;  // m
  track.color.r = track.color.g = track.color.b = 1.0F;
  track.color.a = 0.6F;
  for (const rbpf_core::Pose2& pose : smoothed.nodes) track.points.push_back(point(pose));

  visualization_msgs::Marker closures = track;
  closures.ns = "closures";
  closures.type = visualization_msgs::Marker::LINE_LIST;
  closures.scale.x = 0.15;  // there are hundreds of them
  closures.color.a = 1.0F;
  closures.points.clear();
  for (const auto& closure : smoothed.closures) {
    if (std::isnan(closure.weight)) continue;
    closures.points.push_back(point(smoothed.nodes[closure.k]));
    closures.points.push_back(point(smoothed.nodes[closure.j]));
    std_msgs::ColorRGBA color;
    color.r = static_cast<float>(1.0 - closure.weight);
    color.g = static_cast<float>(closure.weight);
    color.a = 0.8F;
    closures.colors.insert(closures.colors.end(), 2, color);
  }
  visualization_msgs::MarkerArray graph;
  if (!track.points.empty()) graph.markers.push_back(track);
  if (!closures.points.empty()) graph.markers.push_back(closures);
  graph_.publish(graph);
}

void Publishers::publishPaths(const std_msgs::Header& header) {
  const rbpf_core::FilterSnapshot snapshot = filter_.snapshot();
  const std::size_t pings = snapshot.pings();
  nav_msgs::Path path;
  nav_msgs::Path dead_reckoning;
  path.header = dead_reckoning.header = header;
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  const std::size_t stride = 1 + pings / kOverviewPings;
  for (const rbpf_core::SurveyPing& ping : snapshot.survey(0, pings, stride)) {
    geometry_msgs::PoseStamped pose;
    pose.header.frame_id = params_.frames.map;
    pose.header.stamp = ros::Time(ping.record.stamp_s);
    pose.pose = toPose(ping.estimate, ping.record.attitude);
    path.poses.push_back(pose);
    pose.pose = toPose(ping.record.dead_reckoning, ping.record.attitude);
    dead_reckoning.poses.push_back(pose);
    append(placeBeams(ping.levelled_m, ping.estimate), cloud.get());
  }
  path_.publish(path);
  dead_reckoning_path_.publish(dead_reckoning);

  pcl::VoxelGrid<pcl::PointXYZ> voxels;
  const auto size = static_cast<float>(params_.bathymetry_voxel_m);
  voxels.setLeafSize(size, size, size);
  voxels.setInputCloud(cloud);
  pcl::PointCloud<pcl::PointXYZ> thinned;
  voxels.filter(thinned);
  publishCloud(bathymetry_, thinned, header);
}

void Publishers::publishCloud(const ros::Publisher& publisher,
                              const pcl::PointCloud<pcl::PointXYZ>& cloud,
                              const std_msgs::Header& header) const {
  sensor_msgs::PointCloud2 message;
  pcl::toROSMsg(cloud, message);
  message.header = header;
  publisher.publish(message);
}

void Publishers::publishStatus(const rbpf_svgp_slam::FilterStatus& status) {
  status_.publish(status);
}

}  // namespace rbpf_node
