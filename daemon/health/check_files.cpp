// The files without which boothd does not start: body models, and the key to which sessions are sealed. They are read as boothd reads them.
#include <unistd.h>

#include <cerrno>

#include "daemon/health/checks.hpp"
#include "daemon/io/model_file.hpp"
#include "daemon/seal/keys.hpp"

namespace booth::daemon {
namespace {

Check check_models(const Config& config) {
  try {
    const auto folder = find_models(config.models.directory);
    if (config.fit.sex != "women") (void)load_body_model(folder / "men.npz");
    if (config.fit.sex != "men") (void)load_body_model(folder / "women.npz");
    (void)load_pose_prior(folder / "pose.npz");
    return {"files", "body models", CheckResult::ok, folder.string() + " has them, and they can be read"};
  } catch (const std::exception& e) {
    return {"files", "body models", CheckResult::error, e.what(), "boothd does not start like this: install boothd-models anew, or see models.directory"};
  }
}

Check check_key(const std::string& file) {
  if (file.empty()) return {"files", "key of privacy.seal_to", CheckResult::skipped, "sessions and recordings are not sealed"};
  if (::access(file.c_str(), R_OK) != 0 && errno == EACCES)
    return {"files", "key of privacy.seal_to", CheckResult::skipped, file + " cannot be read by this user; run doctor as root"};
  try {
    return {"files", "key of privacy.seal_to", CheckResult::ok, "what is written is sealed to key " + read_public_key(file).id()};
  } catch (const std::exception& e) {
    return {"files", "key of privacy.seal_to", CheckResult::error, e.what(),
            "boothd does not start like this: put the public key there (docs/guide/privacy.md)"};
  }
}

}  // namespace

Checks check_files(const DoctorInputs& in) { return {check_models(in.config), check_key(in.config.privacy.seal_to)}; }

}  // namespace booth::daemon
