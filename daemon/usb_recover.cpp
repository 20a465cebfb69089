// boothd-usb-recover STEP: the one program of boothd that runs as root, started for one request and gone after it.
#include <cstdlib>
#include <string>

#include "daemon/drivers_factory.recover.hpp"
#include "daemon/health/log.hpp"

int main(int argc, char** argv) {
  using namespace booth::daemon;
  if (argc != 2) {
    log_line(LogLevel::error, "usage: boothd-usb-recover port|controller|usbfs-memory; boothd-usb-recover@.service starts it");
    return 64;
  }
  const auto folder = [](const char* name, const char* usual) {
    const char* set = std::getenv(name);
    return std::string(set != nullptr && *set != '\0' ? set : usual);
  };
  const auto report =
      answer_recover_step(argv[1], folder("BOOTHD_USB_REQUESTS", "/run/boothd/usb-recover"), folder("RUNTIME_DIRECTORY", "/run/boothd-usb-recover"));
  log_line(report.failed ? LogLevel::error : LogLevel::warning, report.sentence);
  if (!report.known) return 64;
  return report.failed ? 1 : 0;
}
