#include "rbpf_node/taken_name.hpp"

#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <xmlrpcpp/XmlRpcSocket.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <cstdint>
#include <stdexcept>
#include <string>

namespace rbpf_node {

namespace {

// Of a host; one that has been switched off never answers.
constexpr timeval kAnswer{5, 0};

bool listens(const std::string& uri) {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return false;
  const int socket = XmlRpc::XmlRpcSocket::socket();
  if (socket < 0) return false;
  setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &kAnswer, sizeof kAnswer);  // of connecting, too
  const bool connected = XmlRpc::XmlRpcSocket::connect(socket, host, static_cast<int>(port));
  XmlRpc::XmlRpcSocket::close(socket);
  return connected;
}

}  // namespace

void expectNameIsFree() {
  const std::string& name = ros::this_node::getName();
  XmlRpc::XmlRpcValue request;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue uri;
  request[0] = name;
  request[1] = name;
  const bool is_registered = ros::master::execute("lookupNode", request, response, uri, true);
  if (!is_registered || !listens(uri)) return;
  throw std::runtime_error(name + " runs already, at " + std::string(uri) +
                           "; expected one at a ROS master: end the survey that it belongs to, or "
                           "start this one with a master of its own");
}

}  // namespace rbpf_node
