#include <gtest/gtest.h>
#include <std_msgs/String.h>
#include <tf2_msgs/TFMessage.h>

#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "rbpf_node/bag_mounts.hpp"

namespace rbpf_node {
namespace {

geometry_msgs::TransformStamped transform(const std::string& parent, const std::string& child,
                                          double x_m) {
  geometry_msgs::TransformStamped transform;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform.translation.x = x_m;
  transform.transform.rotation.w = 1.0;
  return transform;
}

class BagMounts : public testing::Test {
 protected:
  void SetUp() override {
    ros::Time::init();
    bag_.open(path_, rosbag::bagmode::Write);
  }
  void TearDown() override { std::remove(path_.c_str()); }

  void write(const std::string& topic, const geometry_msgs::TransformStamped& transform) {
    tf2_msgs::TFMessage message;
    message.transforms = {transform};
    bag_.write(topic, ros::Time(++time_s_), message);
  }

  // By child frame: "parent x".
  std::map<std::string, std::string> mounts(const std::set<std::string>& sensors) {
    bag_.close();
    bag_.open(path_, rosbag::bagmode::Read);
    const Mounts found = mountsIn(bag_, Frames(), sensors);
    changed_ = inWords(found.changed);
    return inWords(found.first);
  }

  using Words = std::map<std::string, std::string>;

  static Words inWords(const std::vector<geometry_msgs::TransformStamped>& mounts) {
    Words words;
    for (const auto& mount : mounts) {
      char x_m[16];
      std::snprintf(x_m, sizeof(x_m), "%.1f", mount.transform.translation.x);
      words[mount.child_frame_id] = mount.header.frame_id + " " + x_m;
    }
    return words;
  }

  const std::string path_ =
      testing::TempDir() + testing::UnitTest::GetInstance()->current_test_info()->name() + ".bag";
  rosbag::Bag bag_;
  std::map<std::string, std::string> changed_;
  double time_s_ = 0.0;
};

TEST_F(BagMounts, AreAllStaticTransforms) {
  write("/tf_static", transform("base_link", "mbes", 1.0));
  write("/tf_static", transform("base_link", "camera", 2.0));
  write("/tf", transform("odom", "base_link", 3.0));
  EXPECT_EQ(mounts({"mbes"}), (Words{{"camera", "base_link 2.0"}, {"mbes", "base_link 1.0"}}));
}

TEST_F(BagMounts, AreTheFirstAndTheChangedOnesAreToldApart) {
  write("/tf_static", transform("base_link", "mbes", 1.0));
  write("/tf_static", transform("base_link", "mbes", 1.5));
  write("/tf_static", transform("base_link", "camera", 2.0));
  write("/tf_static", transform("base_link", "camera", 2.0));
  EXPECT_EQ(mounts({"mbes"}), (Words{{"camera", "base_link 2.0"}, {"mbes", "base_link 1.0"}}));
  EXPECT_EQ(changed_, (Words{{"mbes", "base_link 1.5"}}));
}

TEST_F(BagMounts, AreRotations) {
  geometry_msgs::TransformStamped broken = transform("base_link", "mbes", 1.0);
  broken.transform.rotation.w = 0.0;
  write("/tf_static", broken);
  write("/tf_static", transform("base_link", "mbes", 1.5));
  EXPECT_EQ(mounts({"mbes"}), (Words{{"mbes", "base_link 1.5"}}));
  EXPECT_EQ(changed_, Words());
}

TEST_F(BagMounts, AreTheFirstOfThoseOnTfWhereNoStaticOnesLead) {
  write("/tf", transform("odom", "base_link", 9.0));
  write("/tf", transform("/base_link", "/bracket", 1.0));
  write("/tf", transform("base_link", "bracket", 1.2));
  write("/tf", transform("base_link", "wheel", 5.0));
  write("/tf_static", transform("bracket", "mbes", 0.5));
  EXPECT_EQ(mounts({"mbes"}), (Words{{"bracket", "base_link 1.0"}, {"mbes", "bracket 0.5"}}));
  EXPECT_EQ(changed_, (Words{{"bracket", "base_link 1.2"}}));
}

TEST_F(BagMounts, MayLeadUpwardsFromTheBase) {
  write("/tf", transform("mbes", "hull", 1.0));
  write("/tf", transform("hull", "base_link", 2.0));
  EXPECT_EQ(mounts({"mbes"}), (Words{{"base_link", "hull 2.0"}, {"hull", "mbes 1.0"}}));
}

TEST_F(BagMounts, DoNotLeadThroughWhereTheVehicleMoves) {
  write("/tf", transform("odom", "base_link", 9.0));
  write("/tf", transform("odom", "buoy", 4.0));
  EXPECT_EQ(mounts({"buoy", "odom", "nowhere"}), Words());
}

TEST_F(BagMounts, NeedNoTransformForTheBaseItself) {
  write("/tf", transform("odom", "base_link", 9.0));
  EXPECT_EQ(mounts({"base_link"}), Words());
}

TEST_F(BagMounts, EndWhereTransformsGoInACircle) {
  write("/tf", transform("a", "b", 1.0));
  write("/tf", transform("b", "a", 1.0));
  EXPECT_EQ(mounts({"a"}), Words());
}

TEST_F(BagMounts, AreNotSoughtInMessagesOfAnotherType) {
  bag_.write("/tf_static", ros::Time(1.0), std_msgs::String());
  write("/tf", transform("base_link", "mbes", 1.0));
  EXPECT_EQ(mounts({"mbes"}), (Words{{"mbes", "base_link 1.0"}}));
}

}  // namespace
}  // namespace rbpf_node
