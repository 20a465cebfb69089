// Which calibration the cameras of a session had: what makes two sessions comparable, or not.
#pragma once

#include <cstdint>
#include <string>

namespace booth::daemon {

/// Errors are those that the file states as `calibration.held_out.*_mm` (docs/design/calibration.md), in metres; negative: it does not say.
struct CalibrationUsed {
  enum class Source : std::uint8_t {
    unknown,  ///< nothing says where the places of the cameras are from
    layout,   ///< they are taken to stand where the plan of the booth has them
    file,
  };
  Source source = Source::unknown;
  std::string file{};      ///< as it was named to the program
  std::string utc{};       ///< "2026-11-28T09:00:00Z"; empty: not known
  std::string checksum{};  ///< "crc64:0f1e2d3c4b5a6978"; empty: the file has none
  double held_out_corner = -1, held_out_corner_p95 = -1, held_out_plane = -1;
};

}  // namespace booth::daemon
