// The report's nodes for roscpp: wall follower, safety, mux. `nodes wall_follower safety mux` has all three in one
// process, `nodes mux` one of them. A drive is a TwistStamped: linear.x [m/s], angular.z steering [rad]; its header's
// stamp is that of the scan that it answers.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>

namespace {

constexpr double kSpeedMps = 1.0, kDesiredM = 1.0, kKp = 1.6, kKd = 1.5;
constexpr double kNonsenseBelowM = 0.2, kCornerM = 2.0, kStopBelowM = 0.933, kSafetyHoldsS = 0.2;

using Drive = geometry_msgs::TwistStamped;

double meanOfThreeNearest(std::vector<double>& ranges) {
  const size_t n = std::min<size_t>(3, ranges.size());
  std::partial_sort(ranges.begin(), ranges.begin() + n, ranges.end());
  double sum = 0;
  for (size_t i = 0; i < n; ++i) sum += ranges[i];
  return sum / n;
}

double aheadM(const sensor_msgs::LaserScan& scan) {
  std::vector<double> ahead;
  const int middle = static_cast<int>(std::lround(-scan.angle_min / scan.angle_increment));
  for (int i = middle - 2; i <= middle + 2; ++i)
    if (scan.ranges[i] > kNonsenseBelowM) ahead.push_back(scan.ranges[i]);
  return ahead.empty() ? INFINITY : meanOfThreeNearest(ahead);
}

Drive drive(const sensor_msgs::LaserScan& scan, double speed_mps, double steering_rad) {
  Drive message;
  message.header.stamp = scan.header.stamp;
  message.twist.linear.x = speed_mps;
  message.twist.angular.z = steering_rad;
  return message;
}

double steeringRad(const sensor_msgs::LaserScan& scan) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  std::vector<double> distances;
  const int from = std::lround((0.1 * M_PI - scan.angle_min) / scan.angle_increment);
  const int to = std::lround((0.6 * M_PI - scan.angle_min) / scan.angle_increment);
  for (int i = from; i <= to; ++i) {
    const double range = scan.ranges[i];
    if (!(range > kNonsenseBelowM)) continue;
    const double angle = scan.angle_min + i * scan.angle_increment;
    const double x = range * std::cos(angle), y = range * std::sin(angle);
    sx += x, sy += y, sxx += x * x, sxy += x * y;
    distances.push_back(range);
  }
  const double n = distances.size();
  if (n < 3) return 0.0;
  const double angle = std::atan((n * sxy - sx * sy) / (n * sxx - sx * sx));
  double distance = meanOfThreeNearest(distances);
  const double ahead = aheadM(scan);
  if (ahead <= kCornerM) distance = ahead / 2;
  if (std::fabs(angle) > M_PI / 3) return 0.0;
  return kKd * angle + kKp * (distance - kDesiredM);
}

class Nodes {
 public:
  Nodes(ros::NodeHandle& handle, const std::vector<std::string>& roles) {
    auto hints = ros::TransportHints();
    if (ros::param::param("/tcp_nodelay", false)) hints = hints.tcpNoDelay();
    for (const auto& role : roles) {
      if (role == "wall_follower") {
        navigation_ = handle.advertise<Drive>("/navigation", 1);
        subscribers_.push_back(handle.subscribe("/scan", 1, &Nodes::follow, this, hints));
      } else if (role == "safety") {
        safety_ = handle.advertise<Drive>("/safety", 1);
        subscribers_.push_back(handle.subscribe("/scan", 1, &Nodes::guard, this, hints));
      } else {
        output_ = handle.advertise<Drive>("/output", 1);
        subscribers_.push_back(handle.subscribe("/navigation", 1, &Nodes::onNavigation, this, hints));
        subscribers_.push_back(handle.subscribe("/safety", 1, &Nodes::onSafety, this, hints));
      }
    }
  }

 private:
  void follow(const sensor_msgs::LaserScan::ConstPtr& scan) {
    navigation_.publish(drive(*scan, kSpeedMps, steeringRad(*scan)));
  }
  void guard(const sensor_msgs::LaserScan::ConstPtr& scan) {
    if (aheadM(*scan) < kStopBelowM) safety_.publish(drive(*scan, 0.0, 0.0));
  }
  void onSafety(const Drive::ConstPtr& stop) {
    stopped_until_ = ros::SteadyTime::now() + ros::WallDuration(kSafetyHoldsS);
    output_.publish(*stop);
  }
  void onNavigation(const Drive::ConstPtr& wish) {
    if (ros::SteadyTime::now() >= stopped_until_) output_.publish(*wish);
  }

  ros::Publisher navigation_, safety_, output_;
  std::vector<ros::Subscriber> subscribers_;
  ros::SteadyTime stopped_until_;
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "node", ros::init_options::AnonymousName);
  ros::NodeHandle handle;
  Nodes nodes(handle, std::vector<std::string>(argv + 1, argv + argc));
  ros::spin();
}
