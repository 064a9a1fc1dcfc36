// Whether the odometry's two accounts of the vehicle's motion agree, and if not, why.
#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "rbpf_core/finding.hpp"
#include "rbpf_core/motion_model.hpp"

namespace rbpf_core {

// Integrates the twist over windows of 10 s and holds it against the pose's own motion. Drift stays
// far below what counts as disagreement, and so do corrections of the pose by some decimetres: what
// is found is a twist in other units or frames, or none at all. Windows in which the vehicle
// neither sailed nor turned tell nothing.
class TwistAgainstPose {
 public:
  // What is wrong with the one that nobody uses is worth a warning only.
  explicit TwistAgainstPose(Velocity velocity = Velocity::kAuto) : velocity_(velocity) {}

  // In the order of their stamps; one that is not later than the one before is left out.
  void add(const Odometry& odometry);

  // The first time that three of the last five windows disagreed.
  const std::optional<Finding>& finding() const { return finding_; }

 private:
  // What might be wrong with a twist, and is put right before it is integrated.
  enum class Repair { kNone, kYawOfPose, kDegrees, kOdomFrame, kYawSign, kKnots };
  static constexpr std::size_t kRepairs = 6;

  // A track from the origin, in the levelled body frame at its beginning.
  struct Track {
    Pose2 end;
    // Whole turns included.
    double turned_rad = 0.0;
    // Of one interval.
    double largest_step_m = 0.0;
    double largest_step_rad = 0.0;

    void add(const MotionIncrement& motion);
    double straight() const;
  };
  struct Window {
    double begin_s = 0.0;
    Track by_pose;
    std::array<Track, kRepairs> by_twist;
    bool twist_is_empty = true;
    bool pose_stands_still = true;

    const Track& by(Repair repair) const { return by_twist[static_cast<std::size_t>(repair)]; }
  };
  using Windows = std::deque<Window>;

  static MotionIncrement repaired(Repair repair, Odometry from, Odometry to);
  static double positionError(const Window& window, Repair repair);
  static double yawError(const Window& window, Repair repair);
  static bool isExplained(const Windows& windows, Repair repair);
  static std::string causeOf(const Windows& windows);
  static std::string figuresOf(const Window& window);

  void begin(const Odometry& odometry);
  void extend(const Odometry& odometry);
  void judge();
  Finding findingFrom(const Windows& windows, std::size_t disagreeing) const;

  const Velocity velocity_;
  std::optional<Odometry> last_;
  Window window_;
  // The last few in which the vehicle sailed, and in which it turned: a wrong rate shows in turns
  // only, however long the legs between them.
  Windows sailed_;
  Windows turned_;
  std::optional<Finding> finding_;
};

// The same over a whole recording.
std::optional<Finding> twistAgainstPose(const std::vector<Odometry>& odometry, Velocity velocity);

}  // namespace rbpf_core
