// Everything about a booth that its owner may decide, as plain values with their defaults.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace booth::daemon {

/// Defaults are what an installed booth starts with. Ranges and meanings: keys.cpp, from which docs/reference/configuration.md is generated.
struct Config {
  struct {
    std::string id = "booth";
  } booth;
  struct {
    std::string socket = "/run/boothd/control.sock";
  } control;
  struct {
    std::string driver = "synthetic";
    std::int64_t minimum = 2;
    std::string board = "a1";
    double board_square_mm = 0;
    struct {
      std::vector<std::string> serials;
      std::string calibration = "/var/lib/boothd/calibration.toml";
      std::string cache = "/var/lib/boothd/kinect2";
      std::int64_t transfers = 24;
      bool colour = false;
      std::string decoder = "cpu";
    } kinect2;
    struct {
      double rate = 30;
    } emulated;
    struct {
      std::string path;
      std::string pace = "own";
    } recording;
    struct {
      std::string body = "test:1";
      std::string motion = "showcase";
      std::string noise = "kinect2";
      std::int64_t count = 4;
      std::int64_t seed = 1;
      double seconds = 24;
    } synthetic;
  } cameras;
  struct {
    std::string directory;
  } models;
  struct {
    double radius = 2.0, height = 2.5, centre_x = 0.0, centre_y = 0.0;  // metres, booth frame
  } stage;
  struct {
    std::string preset = "booth", backend = "cpu", sex = "auto";
    std::int64_t particles = 0;
    std::int64_t threads = 2;
    std::int64_t seed = 1;
  } fit;
  struct {
    std::string directory = "/var/lib/boothd/sessions";
    std::int64_t quota_bytes = 10'000'000'000;
    std::int64_t max_age_days = 30;
    double max_seconds = 1800, search_seconds = 60, lost_seconds = 0.5, estimate_seconds = 300, pause_seconds = 300, countdown_seconds = 0;
  } session;
  struct {
    std::string chip, start, stop, emergency_stop, light, buzzer;
    std::string bias = "pull-up";
    bool active_low = true, emergency_stop_active_low = false, light_active_low = false;
    double debounce_ms = 20, long_press_seconds = 0, stuck_seconds = 30;
  } gpio;
  struct {
    bool depth = false, on_fault = true;
    std::string directory = "/var/lib/boothd/recordings";
    double memory_seconds = 30;
    std::int64_t memory_bytes = 800 << 20;
    std::int64_t keep_free_bytes = 1 << 30;
    std::int64_t quota_bytes = 20'000'000'000;
    std::int64_t max_age_days = 7;
  } record;
  struct {
    std::string seal_to;
  } privacy;
  struct {
    bool enabled = true;
    std::int64_t domain = 0;
    std::string interface;
    bool multicast = true;
    std::vector<std::string> peers;
    std::string security = "off", credentials, self_issued = "/var/lib/boothd/security";
    std::int64_t expiry_warning_days = 30;
    bool ros2 = false;
    std::string ros2_namespace;
  } dds;
  struct {
    std::string level = "info";
  } log;
  struct {
    std::string system_calls = "narrow";
  } hardening;
};

}  // namespace booth::daemon
