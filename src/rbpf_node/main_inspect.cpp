// rbpf_inspect_bag: facts about a bag for check_bag.py, which explains them. Needs no ROS master.
//   rbpf_inspect_bag F.bag                                    what it holds, JSON on stdout
//   rbpf_inspect_bag F.bag FOLDER ODOM PINGS [TRUTH] <PARAMS  what its topics say, files in FOLDER;
//                          PARAMS: the tree of parameters as XML-RPC, as the parameter server has
//                          it
#include <ros/console.h>
#include <ros/time.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "rbpf_node/bag_contents.hpp"
#include "rbpf_node/bag_inspection.hpp"

namespace {

constexpr int kWrongParameter = 2;

XmlRpc::XmlRpcValue treeFrom(std::istream& input) {
  const std::string text((std::istreambuf_iterator<char>(input)), {});
  int offset = 0;
  XmlRpc::XmlRpcValue tree(text, &offset);
  if (!tree.valid()) throw std::runtime_error("no parameters on stdin, expected XML-RPC");
  return tree;
}

void run(const std::vector<std::string>& arguments) {
  rosbag::Bag bag;
  if (arguments.size() == 1) {
    rbpf_node::openBag(arguments[0], &bag);
    std::cout << rbpf_node::bagContents(bag) << std::endl;
    return;
  }
  if (arguments.size() != 4 && arguments.size() != 5) {
    throw std::runtime_error("expected F.bag, or F.bag FOLDER ODOM PINGS [TRUTH]");
  }
  rbpf_node::BagInspection inspection(rbpf_node::validParameters(treeFrom(std::cin)));
  inspection.read(bag, rbpf_node::openBag(arguments[0], {arguments[2], arguments[3], {}}, &bag));
  if (arguments.size() == 5) inspection.readGroundTruth(bag, arguments[4]);
  inspection.write(arguments[1]);
}

}  // namespace

int main(int argc, char** argv) {
  ros::Time::init();
  // what is logged is counted, too
  if (ros::console::set_logger_level(ROSCONSOLE_DEFAULT_NAME, ros::console::levels::Fatal)) {
    ros::console::notifyLoggerLevelsChanged();
  }
  try {
    run({argv + 1, argv + argc});
  } catch (const std::invalid_argument& error) {  // of validParameters()
    std::fprintf(stderr, "%s\n", error.what());
    return kWrongParameter;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return EXIT_FAILURE;
  }
  return EXIT_SUCCESS;
}
