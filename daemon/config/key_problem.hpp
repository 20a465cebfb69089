// A mistake that shows only where values are used, and which keys it may lie in.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace booth::daemon {

struct KeyProblem {
  std::vector<std::string_view> keys;  ///< of the configuration, all that the sentence may be about; the likeliest first
  std::string sentence;                ///< the thing and the remedy, without the place (LoadedConfig::placed())
};

}  // namespace booth::daemon
