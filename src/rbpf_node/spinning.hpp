// The node's callback queues and their threads.
#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>

#include <memory>

namespace rbpf_node {

class Spinning {
 public:
  Spinning() : private_node_("~") {
    private_node_.setCallbackQueue(&service_queue_);
    input_node_.setCallbackQueue(&input_queue_);
  }

  ros::NodeHandle& node() { return node_; }                 // timers, map nodes' status: one thread
  ros::NodeHandle& privateNode() { return private_node_; }  // services: a thread for each client
  ros::NodeHandle& inputNode() { return input_node_; }  // odometry and pings: one thread, in order

  // service_threads: at least one for each client that may call at the same time.
  void start(std::size_t service_threads) {
    spinners_.push_back(std::make_unique<ros::AsyncSpinner>(1));
    spinners_.push_back(std::make_unique<ros::AsyncSpinner>(1, &input_queue_));
    spinners_.push_back(std::make_unique<ros::AsyncSpinner>(
        static_cast<std::uint32_t>(service_threads), &service_queue_));
    for (const auto& spinner : spinners_) spinner->start();
  }

  void stop() { spinners_.clear(); }

 private:
  // queues outlive the handles, handles outlive the spinners
  ros::CallbackQueue input_queue_;
  ros::CallbackQueue service_queue_;
  ros::NodeHandle node_;
  ros::NodeHandle private_node_;
  ros::NodeHandle input_node_;
  std::vector<std::unique_ptr<ros::AsyncSpinner>> spinners_;
};

}  // namespace rbpf_node
