// Services that answer with success and a message, as std_srvs/Trigger does.
#pragma once

#include <ros/node_handle.h>
#include <std_srvs/Trigger.h>

#include <boost/function.hpp>
#include <exception>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "rbpf_node/asked_step.hpp"

namespace rbpf_node {

class TriggerServices {
 public:
  // Advertises on the node's callback queue.
  explicit TriggerServices(ros::NodeHandle node) : node_(std::move(node)) {}

  // What the function throws is the answer too: a failure, and why.
  template <typename Service = std_srvs::Trigger>
  void add(const std::string& name,
           std::function<Answer(const typename Service::Request&)> answer) {
    using Request = typename Service::Request;
    using Response = typename Service::Response;
    const boost::function<bool(Request&, Response&)> serve =
        [answer = std::move(answer)](const Request& request, Response& response) {
          Answer answered{false, ""};
          try {
            answered = answer(request);
          } catch (const std::exception& error) {
            answered.message = error.what();
          }
          response.success = answered.success;
          response.message = answered.message;
          return true;
        };
    servers_.push_back(node_.advertiseService(name, serve));
  }

 private:
  ros::NodeHandle node_;
  std::vector<ros::ServiceServer> servers_;
};

}  // namespace rbpf_node
