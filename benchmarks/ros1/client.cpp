// Publishes scans and times the drives that come back: `client FILE RATE_HZ WARM_UP ONSET_EVERY ONSET_LENGTH SCANS LINKS`.
// FILE: int32 beams, int32 free scans, int32 blocked scans, then float32 ranges [m]. ONSET_EVERY 0: never blocked.
// LINKS: how many connections take the scans.
// Prints one line of JSON: the time of each answered scan in ms, scans without answer, onsets, drives that slipped.
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <vector>

#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>

namespace {

std::mutex mutex;
std::vector<double> sent_s, answered_s;
std::vector<bool> blocked;
size_t warm_up = 0;
long slipped = 0;

double nowS() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec + now.tv_nsec * 1e-9;
}

void onDrive(const geometry_msgs::TwistStamped::ConstPtr& drive) {
  const double now_s = nowS();
  const size_t scan = drive->header.stamp.sec;  // the scans are numbered by their stamps
  std::lock_guard<std::mutex> lock(mutex);
  if (scan == 0 || scan > sent_s.size()) return;
  if (answered_s[scan - 1] == 0) answered_s[scan - 1] = now_s;
  if (scan > warm_up && blocked[scan - 1] && drive->twist.linear.x != 0) ++slipped;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "client", ros::init_options::AnonymousName);
  const double rate_hz = atof(argv[2]);
  warm_up = atol(argv[3]);
  const size_t every = atol(argv[4]), length = atol(argv[5]), scans = atol(argv[6]);
  std::ifstream file(argv[1], std::ios::binary);
  int header[3];
  file.read(reinterpret_cast<char*>(header), sizeof header);
  const size_t beams = header[0], free_scans = header[1], blocked_scans = header[2];
  std::vector<std::vector<float>> ranges(free_scans + blocked_scans, std::vector<float>(beams));
  for (auto& scan : ranges) file.read(reinterpret_cast<char*>(scan.data()), beams * sizeof(float));

  ros::NodeHandle handle;
  auto hints = ros::TransportHints();
  if (ros::param::param("/tcp_nodelay", false)) hints = hints.tcpNoDelay();
  ros::Publisher publisher = handle.advertise<sensor_msgs::LaserScan>("/scan", 1);
  ros::Subscriber subscriber = handle.subscribe("/output", 10, onDrive, hints);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const double give_up_s = nowS() + 20;
  const unsigned links = atol(argv[7]);
  while (publisher.getNumSubscribers() < links || subscriber.getNumPublishers() < 1) {
    if (nowS() > give_up_s) return fprintf(stderr, "the nodes did not come up\n"), 1;
    usleep(10000);
  }
  usleep(300000);

  sensor_msgs::LaserScan scan;
  scan.header.frame_id = "laser";
  scan.angle_min = -0.75 * M_PI;
  scan.angle_max = 0.75 * M_PI;
  scan.angle_increment = 1.5 * M_PI / (beams - 1);
  scan.range_min = 0.02;
  scan.range_max = 30;
  double next_s = nowS();
  for (size_t i = 0; i < warm_up + scans; ++i) {
    const bool stop = every && i % every >= every - length;
    scan.ranges = ranges[i % free_scans + (stop ? free_scans : 0)];
    scan.header.stamp = ros::Time(i + 1, 0);
    next_s += 1 / rate_hz;
    const double left_s = next_s - nowS();
    if (left_s > 0) usleep(static_cast<useconds_t>(left_s * 1e6));
    std::unique_lock<std::mutex> lock(mutex);
    blocked.push_back(stop);
    answered_s.push_back(0);
    sent_s.push_back(nowS());
    lock.unlock();
    publisher.publish(scan);
  }
  usleep(300000);

  long unanswered = 0, onsets = 0;
  printf("{\"latency_ms\": [");
  const char* comma = "";
  for (size_t i = warm_up; i < sent_s.size(); ++i) {
    if (blocked[i] && !blocked[i - 1]) ++onsets;
    if (answered_s[i] == 0) {
      ++unanswered;
    } else {
      printf("%s%.4f", comma, (answered_s[i] - sent_s[i]) * 1e3);
      comma = ", ";
    }
  }
  printf("], \"unanswered\": %ld, \"onsets\": %ld, \"slipped\": %ld}\n", unanswered, onsets, slipped);
}
