// Start, stop and calibrate as the buttons do, a snapshot as boothctl does.
#include "daemon/session/remote_commands.hpp"

namespace booth::daemon {
namespace {

DdsAnswer request(SessionEvent event, Controller& controller) {
  const ControlAnswer answer = controller.request(event, "dds");
  return {answer.accepted, wire_state(answer.state), answer.text};
}

DdsAnswer not_supported(const char* what, const Controller& controller) {
  return {false, wire_state(controller.state()), std::string(what) + " is not supported yet by this version"};
}

DdsAnswer take_snapshot(const Controller& controller, hal::FlightRecorder& recorder) {
  const std::string why_not = recorder.snapshot("asked for on DDS");
  return {why_not.empty(), wire_state(controller.state()), why_not};
}

}  // namespace

DdsAnswer answer_remote_command(DdsCommand command, Controller& controller, hal::FlightRecorder& recorder) {
  switch (command) {
    case DdsCommand::start:
      return request(SessionEvent::start, controller);
    case DdsCommand::stop:
      return request(SessionEvent::stop, controller);
    case DdsCommand::calibrate:
      return request(SessionEvent::calibrate, controller);
    case DdsCommand::snapshot:
      return take_snapshot(controller, recorder);
  }
  return not_supported("this command", controller);
}

}  // namespace booth::daemon
