// Requests to the one program that runs as root: whatever lies in the folder, names are checked, the answer is one line, and the request is gone.
#include <array>
#include <string>

#include "drivers/usb/recover_request.hpp"
#include "tests/drivers/usb/planted_sysfs.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/scratch.hpp"

namespace {

using namespace booth::drivers::usb;
using booth::fuzz::require;

struct Machine {
  Machine() {
    tree.controller({.link_width = "1", .link_speed = "5.0 GT/s PCIe"});
    tree.sensor("2-1", {.streaming = true});
    std::filesystem::create_directory(scratch.path() / "answers");
    std::filesystem::create_directory(scratch.path() / "requests");
  }
  booth::tests::PlantedSysfs tree;
  booth::fuzz::Scratch scratch;
  PowerControl power{[](const booth::hal::UsbDevice&) { return true; }, tree.root(), [](booth::hal::Nanoseconds) {}};
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Machine machine;
  booth::fuzz::Input in(data, size);
  const unsigned choice = in.u8();
  const auto rest = in.bytes(size);
  std::string text(reinterpret_cast<const char*>(rest.data()), rest.size());
  if (choice & 4) text = "1f " + text + "\n";  // past the form, to what is made of the argument
  if (const auto request = parse_recover_request(text)) {
    require(!request->number.empty() && request->number.size() <= 16, "a number is short");
    require(request->argument.find('/') == std::string::npos, "an argument is no path");
  }
  const auto step = std::array{RecoverStep::port, RecoverStep::controller, RecoverStep::usbfs_memory}[choice % 3];
  const std::string name(to_string(step));
  const auto requests = machine.scratch.path() / "requests", answers = machine.scratch.path() / "answers";
  const auto file = machine.scratch.put("requests/" + name, text);
  const PowerOutcome outcome = answer_recover_request(step, requests, answers, machine.power);
  require(!outcome.sentence.empty(), "an outcome is a sentence");
  require(!std::filesystem::exists(file), "a request is answered once");
  if (std::filesystem::exists(answers / name)) {
    std::ifstream answer(answers / name);
    std::string line;
    std::getline(answer, line);
    require(line.size() < 512 && answer.peek() == std::ifstream::traits_type::eof(), "an answer is one short line");
  }
  (void)parse_recover_step(text);
  return 0;
}
