// Poses that move enough for a reader's mistakes to show.
#include "tests/daemon/record/session_samples.hpp"

#include <cmath>

#include "tests/support/capsule_body.hpp"

namespace booth::tests {

using namespace daemon;

const SessionModels& sample_models() {
  static const SessionModels m{capsule_body(fit::Sex::men), nullptr};
  return m;
}

std::vector<FrameRecord> sample_frames(std::uint64_t count) {
  std::vector<FrameRecord> out;
  for (std::uint64_t k = 0; k < count; ++k) {
    FrameRecord& f = out.emplace_back();
    f.sequence = k;
    f.captured_ns = 1'000'000'000 + static_cast<std::int64_t>(k) * 33'333'333;
    f.captured_utc_ns = 1'767'225'600'000'000'000 + f.captured_ns;
    f.person = k == 0 ? PersonState::estimated : PersonState::tracked;
    f.body_accepted = k >= 2;
    f.shape_count = 2;
    f.beta[0] = 0.5;
    f.residual = 0.01f;
    f.q[1] = 0.9;
    f.q[2] = 0.01 * static_cast<double>(k);
    for (std::size_t d = 3; d < f.q.size(); ++d) f.q[d] = 0.2 * std::sin(0.1 * static_cast<double>(k + d));
    fit::Kinematics kinematics;
    fit::ShapeVector beta(2);
    beta << 0.5, 0;
    fit::forward_kinematics(Eigen::Map<const fit::PoseVector>(f.q.data()), sample_models().men->bone_vectors(beta), kinematics);
    for (std::size_t j = 0; j < kRecordJoints; ++j) {
      const Eigen::Vector3d p = fit::booth_from_cmu(kinematics.joint.col(static_cast<Eigen::Index>(j)));
      f.joints[j] = {p.x(), p.y(), p.z()};
    }
  }
  return out;
}

SessionInfo sample_info() {
  SessionInfo info;
  info.began_utc_ns = 1'767'225'600'000'000'000;
  info.id = make_session_id(info.began_utc_ns);
  info.booth = std::string("test-booth");
  return info;
}

}  // namespace booth::tests
