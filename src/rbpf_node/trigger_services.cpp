#include "rbpf_node/trigger_services.hpp"

#include <std_srvs/Trigger.h>

#include <boost/function.hpp>
#include <exception>
#include <utility>

namespace rbpf_node {

void TriggerServices::add(const std::string& name, std::function<Answer()> answer) {
  using std_srvs::Trigger;
  const boost::function<bool(Trigger::Request&, Trigger::Response&)> serve =
      [answer = std::move(answer)](Trigger::Request&, Trigger::Response& response) {
        Answer answered{false, ""};
        try {
          answered = answer();
        } catch (const std::exception& error) {
          answered.message = error.what();
        }
        response.success = answered.success;
        response.message = answered.message;
        return true;
      };
  servers_.push_back(node_.advertiseService(name, serve));
}

}  // namespace rbpf_node
