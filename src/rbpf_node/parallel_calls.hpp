// The same service on several nodes at once, with a deadline.
#pragma once

#include <ros/node_handle.h>

#include <chrono>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace rbpf_node {

// One answer of a parallel call: empty error on success.
template <typename Service>
struct CallAnswer {
  typename Service::Response response;
  std::string error;
};

// Calls names[k] with requests[k], all at the same time. roscpp's calls have no timeout: one that
// has not come back by the deadline is left to its thread, which ends with the connection.
template <typename Service>
std::vector<CallAnswer<Service>> callAll(const std::vector<std::string>& names,
                                         const std::vector<typename Service::Request>& requests,
                                         double timeout_s) {
  std::vector<std::future<CallAnswer<Service>>> pending;
  for (std::size_t k = 0; k < names.size(); ++k) {
    std::packaged_task<CallAnswer<Service>()> task([name = names[k], request = requests[k]] {
      // Persistent, though used once: when the server closes the connection right after its answer,
      // roscpp may take notice of the closing before the answer, and report a failure.
      ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>(name, true);
      Service call;
      call.request = request;
      if (!client.call(call)) return CallAnswer<Service>{{}, name + " cannot be reached"};
      if (!call.response.success)
        return CallAnswer<Service>{{}, name + ": " + call.response.message};
      return CallAnswer<Service>{std::move(call.response), ""};
    });
    pending.push_back(task.get_future());
    std::thread(std::move(task)).detach();
  }
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  std::vector<CallAnswer<Service>> answers;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const bool came = pending[k].wait_until(deadline) == std::future_status::ready;
    answers.push_back(
        came ? pending[k].get()
             : CallAnswer<Service>{
                   {}, names[k] + " did not answer within " + std::to_string(timeout_s) + " s"});
  }
  return answers;
}

// The answers' errors, joined; empty if all went well.
template <typename Service>
std::string errorsOf(const std::vector<CallAnswer<Service>>& answers) {
  std::string errors;
  for (const CallAnswer<Service>& answer : answers) {
    if (answer.error.empty()) continue;
    errors += (errors.empty() ? "" : "; ") + answer.error;
  }
  return errors;
}

}  // namespace rbpf_node
