// The four sensors of a booth as a program of its own: plugged into the guest's kernel, they see somebody walk, until the program is told to end.
#include <signal.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "daemon/io/model_file.hpp"
#include "drivers/clock/system_clock.hpp"
#include "drivers/kinect2/emulator/scene_view.hpp"
#include "drivers/kinect2/emulator/vhci_box.hpp"
#include "drivers/synthetic/motions.hpp"

namespace {

using namespace booth;
using namespace booth::drivers;
using namespace booth::drivers::kinect2;

constexpr double kFramesPerSecond = 30, kPacketSeconds = 125e-6;  // of a sensor

drivers::Person somebody() {
  const auto directory = daemon::find_models("");
  daemon::TestBody body = daemon::load_test_body(directory / "test_bodies.npz", 3);
  auto model = std::make_shared<const fit::BodyModel>(daemon::load_body_model(directory / (std::string(to_string(body.sex)) + ".npz")));
  auto motion = motion_by_name("walk", 20, contact_of(*model, body.rest, body.rest_joints));
  return make_person("test:3", std::move(model), std::move(body.rest), body.rest_joints, std::move(motion));
}

/// Slower sensors are slower as a whole, packets included: the empty ones between frames would cost a guest more than the full ones.
void serve(double rate, const sigset_t& signals) {
  const auto clock = std::make_shared<SystemClock>();
  const auto box = emulator::make_vhci_box(clock);
  auto sensors = emulator::make_emulated_sensors({}, {somebody()}, rate, clock);
  const auto packet_time = hal::from_seconds(kPacketSeconds * kFramesPerSecond / rate);
  for (auto& device : sensors.devices) box->plug(box->add({.device = std::move(device), .packet_time = packet_time}));
  std::puts("plugged in");
  std::fflush(stdout);
  int signal = 0;
  sigwait(&signals, &signal);
}

}  // namespace

int main(int argc, char** argv) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int s : {SIGTERM, SIGINT}) sigaddset(&signals, s);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  try {
    serve(argc > 1 ? std::stod(argv[1]) : 10, signals);
  } catch (const std::exception& e) {
    std::printf("why: %s\n", e.what());
    return 1;
  }
  return 0;
}
