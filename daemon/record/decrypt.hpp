// A sealed session made readable again, by whoever holds the private key.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "daemon/record/session_files.hpp"
#include "daemon/seal/keys.hpp"

namespace booth::daemon {

struct Decrypted {
  std::vector<std::string> files;       ///< names in the new folder
  std::vector<std::string> complaints;  ///< one sentence for each file that is not whole; it is left out, or holds what came before the damage
};

/// Makes the folder `out` (mode 0700), in which everything is in the clear. Of a session that never came to its end the files are made from its log, for which
/// `models` are asked. Throws std::runtime_error: `out` exists, the key is another one, nothing can be read.
Decrypted decrypt_session(const std::filesystem::path& folder, const PrivateKey& key, const std::filesystem::path& out,
                          const std::function<SessionModels()>& models);

}  // namespace booth::daemon
