// Credentials for both sides of the secured half of bench dds: one participant that may do everything, and the fleet's own governance.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "daemon/dds/dds_settings.hpp"

namespace booth::bench {

/// The files lie in a temporary folder as long as this lives, for ddsperf, which wants files.
struct BenchIdentity {
  BenchIdentity();
  ~BenchIdentity();
  BenchIdentity(const BenchIdentity&) = delete;

  /// The library's configuration with the credentials added.
  std::string secured(const std::string& configuration) const;

  std::shared_ptr<const daemon::DdsIdentity> identity;

 private:
  std::filesystem::path folder_;
};

}  // namespace booth::bench
