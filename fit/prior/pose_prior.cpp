// Checks of the pose prior's data.
#include "fit/prior/pose_prior.hpp"

#include <stdexcept>

namespace booth::fit {

void PosePrior::check() const {
  const auto require = [](bool ok, const char* what) {
    if (!ok) throw std::invalid_argument(std::string("pose prior: ") + what);
  };
  const auto b = components.cols();
  require(b >= 1 && b <= kPoseDofs, "components must be 30 x b with 1 <= b <= 30");
  require(sigma.size() == b, "sigma must have one entry for each component");
  require(mean.allFinite() && components.allFinite() && sigma.allFinite() && standard_deviation.allFinite() && lower.allFinite() && upper.allFinite() &&
              speed_limit.allFinite(),
          "a value is not finite");
  require(exemplars.cols() >= 1 && exemplars.allFinite(), "there is no exemplar pose, or one is not finite");
  require((sigma.array() > 0).all() && (standard_deviation.array() > 0).all() && (speed_limit.array() > 0).all(), "a deviation or speed is not positive");
  require((lower.array() < upper.array()).all(), "a lower limit is not below its upper limit");
  require((components.transpose() * components - Eigen::MatrixXd::Identity(b, b)).cwiseAbs().maxCoeff() < 1e-4, "components are not orthonormal");
}

}  // namespace booth::fit
