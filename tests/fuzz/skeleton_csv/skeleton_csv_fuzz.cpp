// skeleton.csv of any content: rows of finite numbers in the order of time, or one sentence.
#include <cmath>
#include <stdexcept>
#include <string>

#include "daemon/io/csv_file.hpp"
#include "daemon/record/session_reader.hpp"
#include "tests/fuzz/fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string rows(reinterpret_cast<const char*>(data), size);
  for (const std::string& text : {rows, booth::daemon::skeleton_csv_header() + rows}) {
    try {
      std::int64_t last = 0;
      for (const auto& frame : booth::daemon::parse_skeleton_csv(text, "x")) {
        booth::fuzz::require(frame.captured_ns >= last, "time goes on");
        last = frame.captured_ns;
        for (const double q : frame.q) booth::fuzz::require(std::isfinite(q), "poses are finite");
      }
    } catch (const std::runtime_error& e) {
      booth::fuzz::require(std::string(e.what()).starts_with("x: "), "the sentence names the file");
    }
  }
  return 0;
}
